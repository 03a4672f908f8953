// What came in during the last minute, and the moment of it that is shown.

import { wrapped } from "./dom.js";

const PAST_S = 60;
const SIGMAS_95 = Math.sqrt(5.991); // chi-square, 2 degrees of freedom

export class Store {
  constructor() {
    this.begin(null);
  }

  // Another run: nothing of the one before may be mixed with it.
  begin(scene) {
    this.scene = scene;
    this.frames = [];
    this.statuses = [];
    this.held = null; // seconds at which the time stands still
    this.waiting = []; // frames that came in meanwhile
    this.roles = scene ? rolesOf(scene) : {};
  }

  // The same run again, after the line was lost: it numbers its frames anew.
  resume(scene) {
    this.scene = scene;
    this.waiting = [];
    for (const frame of this.frames) frame.n = -1;
  }

  addFrame(frame) {
    const frames = this.held === null ? this.frames : this.waiting;
    const last = frames.at(-1);
    if (last && frame.n <= last.n) return;
    frames.push(enriched(frame, this.roles));
    // Later than the newest is what came in before the clock was set back.
    while (frames[0].at < frame.at - PAST_S || frames[0].at > frame.at) frames.shift();
  }

  addStatus(status) {
    this.statuses.push(status);
    const { held } = this;
    // While the time stands still: what led to that moment, and the newest of what came since.
    this.statuses = this.statuses.filter(({ at }) => at <= status.at && (
      at >= status.at - PAST_S - 2 || (held !== null && at <= held + 1 && at >= held - PAST_S - 2)));
  }

  get newest() {
    return this.frames.at(-1);
  }

  // Time at the right edge of everything that is shown.
  get shownAt() {
    return this.held ?? this.newest?.at ?? 0;
  }

  // Index of the frame that is shown; all up to it are the past of that moment.
  get shownIndex() {
    if (this.held === null) return this.frames.length - 1;
    let low = 0;
    let high = this.frames.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.frames[middle].at <= this.held) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  get shown() {
    return this.frames[this.shownIndex];
  }

  get shownStatus() {
    if (this.held === null) return this.statuses.at(-1);
    return this.statuses.findLast((status) => status.at <= this.held) ?? this.statuses[0];
  }

  // Stand still `back` seconds before the newest frame; 0 goes on. What is shown then stays for
  // as long as somebody wants to talk about it.
  hold(back) {
    const newest = this.newest;
    if (newest && back > 0) {
      this.held = Math.max(this.frames[0].at, newest.at - back);
      return;
    }
    this.held = null;
    const came = this.waiting.splice(0);
    if (came.length) this.frames = this.frames.filter(({ at }) => at < came[0].at);
    for (const frame of came) this.addFrame(frame);
  }
}

function rolesOf(scene) {
  const of = (type) => Object.keys(scene.keys).filter((key) => scene.keys[key].type === type);
  const isTruth = (key) => key.split("/").at(-1) === "truth";
  const odometry = of("Odometry");
  return {
    pose: of("PoseEstimate")[0],
    odom: odometry.find((key) => !isTruth(key)),
    truth: odometry.find(isTruth),
    attitude: of("AttitudeEstimate")[0],
    magnets: of("MagnetDetection")[0],
  };
}

// Adds what is drawn more than once: who is who, sigmas, tilt, distance from the truth.
function enriched(frame, roles) {
  frame.pose = frame.keys[roles.pose];
  frame.odom = frame.keys[roles.odom];
  frame.truth = frame.keys[roles.truth];
  frame.attitude = frame.keys[roles.attitude];
  frame.best = frame.pose ?? frame.odom;
  if (frame.pose) frame.ellipse = ellipse(frame.pose.covariance);
  if (frame.attitude) frame.tilt = euler(frame.attitude.orientation);
  if (frame.truth && frame.pose) frame.error = distance(frame.pose, frame.truth);
  if (frame.truth && frame.odom) frame.drift = distance(frame.odom, frame.truth);
  return frame;
}

// Where b was at the stamp of a: the two are not measured at one moment.
function distance(a, b) {
  const dt = a.stamp - b.stamp;
  const yaw = b.yaw + 0.5 * b.w * dt;
  return Math.hypot(a.x - b.x - b.v * Math.cos(yaw) * dt, a.y - b.y - b.v * Math.sin(yaw) * dt);
}

// 95 % ellipse of x and y: half axes [m] and the direction of the longer one.
function ellipse(covariance) {
  const [xx, xy, , , yy] = covariance;
  const middle = (xx + yy) / 2;
  const spread = Math.hypot((xx - yy) / 2, xy);
  return {
    a: SIGMAS_95 * Math.sqrt(Math.max(0, middle + spread)),
    b: SIGMAS_95 * Math.sqrt(Math.max(0, middle - spread)),
    angle: 0.5 * Math.atan2(2 * xy, xx - yy),
    yaw: Math.sqrt(Math.max(0, covariance[8])),
  };
}

// Roll, pitch, yaw of R = Rz Ry Rx, from a quaternion x, y, z, w.
export function euler([x, y, z, w]) {
  const sine = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  return {
    roll: Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    pitch: Math.asin(sine),
    yaw: wrapped(Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))),
  };
}
