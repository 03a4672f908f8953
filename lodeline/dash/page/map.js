// The map: magnets, where they were seen, trails, the robot with its ellipse. Zoom, pan, follow.

import { FONT, Surface, colours } from "./dom.js";

const MARGIN = 28; // for the legend above and the scale below
const CLOSEST = 600; // px per metre; a run that has just begun needs no magnifying glass
const CLOSE_UP = 150; // px that it covers, on the left
const ROBOT_M = 0.055;
const BAR_M = 0.035;

export class FloorMap {
  constructor(canvas, onView) {
    this.surface = new Surface(canvas, () => this.onView());
    this.onView = onView;
    this.mode = "fit";
    this.scale = 400; // px per metre
    this.centre = [0, 0];
    this.pointers = new Map();
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
  }

  setMode(mode) {
    this.mode = mode;
    this.onView();
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * 0.0015), ...this.surface.at(event));
  }

  // The floor under (px, py) stays where it is.
  zoom(factor, px = this.surface.width / 2, py = this.surface.height / 2) {
    const scale = Math.min(20000, Math.max(4, this.scale * factor));
    if (this.mode !== "follow") {
      const dx = px - this.surface.width / 2;
      const dy = this.surface.height / 2 - py;
      this.centre[0] += dx / this.scale - dx / scale;
      this.centre[1] += dy / this.scale - dy / scale;
    }
    this.scale = scale;
    this.setMode(this.mode === "fit" ? "free" : this.mode);
  }

  down(event) {
    this.surface.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.surface.at(event));
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = this.surface.at(event);
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    if (other) {
      const length = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      this.zoom(length(now) / Math.max(1, length(before)), other[0], other[1]);
    } else {
      this.centre[0] -= (now[0] - before[0]) / this.scale;
      this.centre[1] += (now[1] - before[1]) / this.scale;
      this.setMode("free");
    }
  }

  // All that is to be seen, with a margin; slowly enough for the eye.
  fit(frames, last) {
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i <= last; i += 4) {
      const { best } = frames[i];
      if (!best) continue;
      west = Math.min(west, best.x);
      east = Math.max(east, best.x);
      south = Math.min(south, best.y);
      north = Math.max(north, best.y);
    }
    if (west > east) return;
    const pad = 0.09;
    const wide = (this.surface.width - MARGIN) / (east - west + 2 * pad);
    const high = (this.surface.height - 2 * MARGIN) / (north - south + 2 * pad);
    this.scale = Math.min(wide, high, CLOSEST);
    // Beside the close-up, where there is room to spare.
    const slack = this.surface.width - MARGIN - (east - west + 2 * pad) * this.scale;
    const aside = Math.max(0, Math.min(slack, CLOSE_UP)) / 2;
    this.centre = [(west + east) / 2 - aside / this.scale, (south + north) / 2];
  }

  draw(store) {
    const index = store.shownIndex;
    const frame = store.frames[index];
    if (this.mode === "fit" && frame) this.fit(store.frames, index);
    if (this.mode === "follow" && frame?.best) this.centre = [frame.best.x, frame.best.y];
    const c = this.surface.begin();
    if (!c) return;
    const { width, height } = this.surface;
    this.x = (x) => width / 2 + (x - this.centre[0]) * this.scale;
    this.y = (y) => height / 2 - (y - this.centre[1]) * this.scale;
    if (!store.scene) return;
    if (store.roles.magnets) this.lattice(c, store.scene.floor, store.frames, index);
    this.trail(c, store.frames, index, "truth", colours.truth, 5, [], 0.35);
    this.trail(c, store.frames, index, "odom", colours.odom, 2, [7, 4], 1);
    this.trail(c, store.frames, index, "pose", colours.ekf, 2.4, [], 1);
    this.robotAt = frame?.best && [this.x(frame.best.x), this.y(frame.best.y)];
    if (frame?.best) this.robot(c, frame, store.scene.floor.bar_x);
    else this.nothingYet(c, store);
    this.scaleBar(c);
  }

  lattice(c, floor, frames, index) {
    const { width, height } = this.surface;
    const step = floor.pitch * this.scale;
    if (step >= 5) {
      const first = (low, origin) => Math.ceil((low - origin) / floor.pitch);
      const west = this.centre[0] - width / 2 / this.scale;
      const south = this.centre[1] - height / 2 / this.scale;
      const radius = Math.min(4, Math.max(0.9, step * 0.055));
      c.fillStyle = colours.magnet;
      c.beginPath();
      const i0 = first(west, floor.origin[0]);
      const j0 = first(south, floor.origin[1]);
      for (let i = i0; i < i0 + width / step; i += 1) {
        const x = this.x(floor.origin[0] + i * floor.pitch);
        for (let j = j0; j < j0 + height / step; j += 1) {
          const y = this.y(floor.origin[1] + j * floor.pitch);
          if (radius < 2) c.rect(x - radius, y - radius, 2 * radius, 2 * radius);
          else {
            c.moveTo(x + radius, y);
            c.arc(x, y, radius, 0, 7);
          }
        }
      }
      c.fill();
    }
    this.hits(c, floor, frames, index, step);
  }

  // A ring about each magnet that was seen, a small cross where the robot thought it to be.
  hits(c, floor, frames, index, step) {
    const seen = new Map();
    c.strokeStyle = colours.hit;
    c.lineWidth = 1;
    c.globalAlpha = 0.7;
    c.beginPath();
    const arm = Math.min(4, Math.max(1.5, step * 0.06));
    for (let n = 0; n <= index; n += 1) {
      for (const [x, y] of frames[n].hits) {
        const i = Math.round((x - floor.origin[0]) / floor.pitch);
        const j = Math.round((y - floor.origin[1]) / floor.pitch);
        seen.set(`${i} ${j}`, [i, j]);
        if (step < 30) continue;
        c.moveTo(this.x(x) - arm, this.y(y));
        c.lineTo(this.x(x) + arm, this.y(y));
        c.moveTo(this.x(x), this.y(y) - arm);
        c.lineTo(this.x(x), this.y(y) + arm);
      }
    }
    c.stroke();
    c.globalAlpha = 1;
    c.lineWidth = 1.6;
    c.beginPath();
    const radius = Math.min(11, Math.max(2, step * 0.16));
    for (const [i, j] of seen.values()) {
      const x = this.x(floor.origin[0] + i * floor.pitch);
      const y = this.y(floor.origin[1] + j * floor.pitch);
      c.moveTo(x + radius, y);
      c.arc(x, y, radius, 0, 7);
    }
    c.stroke();
  }

  // Older parts fade; a jump of a quarter of a metre between frames is not a way that was driven.
  trail(c, frames, index, who, colour, width, dash, alpha) {
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.lineJoin = "round";
    const chunks = 6;
    const size = Math.ceil((index + 1) / chunks);
    let offset = 0;
    for (let part = 0; part < chunks; part += 1) {
      c.globalAlpha = alpha * (0.3 + (0.7 * (part + 1)) / chunks);
      c.setLineDash(dash);
      c.lineDashOffset = offset;
      c.beginPath();
      let last = null;
      for (let i = part * size; i <= Math.min(index, (part + 1) * size); i += 1) {
        const at = frames[i][who];
        if (!at) continue;
        const [px, py] = [this.x(at.x), this.y(at.y)];
        const length = last ? Math.hypot(px - last[0], py - last[1]) : 0;
        if (last && length < 1 && i < index) continue;
        if (last && length < 0.25 * this.scale) {
          c.lineTo(px, py);
          offset += length;
        } else c.moveTo(px, py);
        last = [px, py];
      }
      c.stroke();
    }
    c.setLineDash([]);
    c.globalAlpha = 1;
  }

  robot(c, frame, ahead) {
    const { x, y, yaw } = frame.best;
    const size = Math.max(ROBOT_M * this.scale, 9);
    c.save();
    c.translate(this.x(x), this.y(y));
    if (frame.ellipse) {
      c.save();
      c.rotate(-frame.ellipse.angle);
      c.beginPath();
      c.ellipse(0, 0, frame.ellipse.a * this.scale, frame.ellipse.b * this.scale, 0, 0, 7);
      c.fillStyle = colours.ekf;
      c.globalAlpha = 0.25;
      c.fill();
      c.restore();
    }
    c.rotate(-yaw);
    const bar = Math.max(ahead * this.scale, size * 1.4);
    const half = Math.max(BAR_M * this.scale, 6);
    c.strokeStyle = colours.ink;
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(0, 0);
    c.lineTo(bar, 0);
    c.moveTo(bar, -half);
    c.lineTo(bar, half);
    c.stroke();
    c.beginPath();
    c.moveTo(size, 0);
    c.lineTo(-size * 0.72, size * 0.72);
    c.lineTo(-size * 0.38, 0);
    c.lineTo(-size * 0.72, -size * 0.72);
    c.closePath();
    c.fillStyle = colours.panel;
    c.strokeStyle = frame.pose ? colours.ekf : colours.odom;
    c.globalAlpha = 0.85;
    c.fill();
    c.globalAlpha = 1;
    c.lineWidth = 2.5;
    c.stroke();
    c.restore();
  }

  nothingYet(c, store) {
    const { width, height } = this.surface;
    const recorded = store.scene.badge === "REPLAY";
    const lines = [
      store.roles.pose || store.roles.odom ? "No pose yet" : "Nothing here tells a pose",
      ...(recorded ? ["lodeline bag play FILE"] : []),
    ];
    c.textAlign = "center";
    lines.forEach((text, i) => {
      c.font = `${i ? 13 : 17}px ${FONT}`;
      const wide = c.measureText(text).width / 2 + 12;
      const y = height / 2 + i * 26;
      c.fillStyle = colours.panel;
      c.fillRect(width / 2 - wide, y - 18, 2 * wide, 26);
      c.fillStyle = colours["ink-2"];
      c.fillText(text, width / 2, y);
    });
  }

  scaleBar(c) {
    const { width, height } = this.surface;
    const steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];
    const metres = steps.find((step) => step * this.scale >= 60) ?? 100;
    const text = metres < 1 ? `${Math.round(metres * 100)} cm` : `${metres} m`;
    const length = metres * this.scale;
    const [left, y] = [Math.max(170, width / 2 - length / 2), height - 12];
    c.strokeStyle = colours["ink-2"];
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(left, y - 4);
    c.lineTo(left, y);
    c.lineTo(left + length, y);
    c.lineTo(left + length, y - 4);
    c.stroke();
    c.fillStyle = colours["ink-2"];
    c.font = `12px ${FONT}`;
    c.textAlign = "center";
    c.fillText(text, left + length / 2, y - 6);
  }
}
