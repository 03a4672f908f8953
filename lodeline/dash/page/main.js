// The page: takes what the gateway sends, and draws what has changed.

import { $, NONE, degrees, duration, el, fixed, put, readColours, svg, wrapped } from "./dom.js";
import { Calibration } from "./calibrate.js";
import { CloseUp } from "./closeup.js";
import { Drive } from "./drive.js";
import { Graph } from "./graph.js";
import { healthOf, nodesOf } from "./health.js";
import { Compass, Horizon } from "./instruments.js";
import { Log } from "./log.js";
import { FloorMap } from "./map.js";
import { Detail, NodeTable } from "./nodes.js";
import { Plots } from "./plots.js";
import { Line } from "./socket.js";
import { Store } from "./store.js";

const PLOTS_MS = 250;
const NOTE_MS = 5000;
const STALE_S = 1;

const store = new Store();
let dirty = true;
const redraw = () => { dirty = true; };
const map = new FloorMap($("map"), () => { showView(); redraw(); });
const closeUp = new CloseUp($("closeup"));
const horizon = new Horizon($("horizon"));
const compass = new Compass($("compass"));
const plots = new Plots($("plots"));
const log = new Log($("log"));
const detail = new Detail(log, (node) => line.send({ do: "restart", node }));
const pick = (name) => { drive.letGo(); detail.open(name, store); };
const graph = new Graph($("graph"), pick);
const table = new NodeTable($("nodes"), pick);
const calibration = new Calibration();
const drive = new Drive((message) => line.send(message));
let trusted = false;

function setState(state, text, alarm = "") {
  document.documentElement.dataset.state = state;
  put($("connection-text"), text);
  put($("alarm"), alarm);
  $("alarm").hidden = !alarm;
}

const line = new Line({
  expecting: () => document.documentElement.dataset.state !== "gone",
  hello(said) {
    trusted = said.trusted;
    detail.trusted = trusted;
    put($("access"), trusted ? "" : "read-only");
  },
  scene(said) {
    // Back on the line within one run, what somebody paused at stays.
    const again = store.scene?.started === said.started && store.scene?.digest === said.digest;
    if (again && store.held !== null) store.resume(said);
    else store.begin(said);
    if (!again) log.add(Date.now() / 1e3, "page", `connected to ${said.name}, pipeline ${said.digest}`);
    document.title = `${said.name} \u00b7 Lodeline`;
    put($("name"), said.name);
    put($("badge"), said.badge);
    $("badge").dataset.kind = said.badge;
    $("badge").hidden = false;
    put($("hosts"), `${said.hosts.join(" + ")} \u00b7 ${said.digest}`);
    $("error-row").hidden = !store.roles.truth;
    $("bound-row").hidden = !store.roles.pose;
    $("horizon-box").hidden = !store.roles.attitude;
    plots.begin(store);
    showLegend();
    drive.allow(trusted && said.drive);
    setState("live", "live");
    showHeld();
    redraw();
  },
  gone(said) {
    drive.allow(false);
    log.add(Date.now() / 1e3, "page", `${said.name} does not run`);
    setState("gone", "DISCONNECTED", `DISCONNECTED \u2013 ${said.name} does not run. Start it with: lodeline up`);
  },
  past(said) {
    for (const frame of said.frames) store.addFrame(frame);
    redraw();
  },
  frame(said) {
    store.addFrame(said);
    redraw();
  },
  status(said) {
    store.addStatus(said);
    showStatus();
  },
  log(said) {
    for (const [at, who, text] of said.lines) log.addOnce(at, who, text);
  },
  calibrate(said) {
    calibration.show(said);
  },
  note(said) {
    note(said.text);
  },
  refused(said) {
    note(said.text);
    drive.turn(false);
  },
  closed(reason) {
    drive.allow(false);
    const why = reason || "the gateway does not answer. Trying again; if it was stopped: lodeline dash";
    setState("disconnected", "DISCONNECTED", `DISCONNECTED \u2013 ${why}`);
  },
});

let noteTimer;
function note(text) {
  log.add(Date.now() / 1e3, "page", text);
  put($("note"), text);
  $("note").classList.add("shown");
  clearTimeout(noteTimer);
  noteTimer = setTimeout(() => $("note").classList.remove("shown"), NOTE_MS);
}

function showLegend() {
  const items = [
    store.roles.pose && ["EKF", "ekf", 2.4, ""],
    store.roles.odom && ["odometry", "odom", 2, "7 4"],
    store.roles.truth && ["truth", "truth", 5, ""],
  ].filter(Boolean).map(([name, colour, width, dash]) => {
    const stroke = { d: "M0 5h24", stroke: `var(--${colour})`, "stroke-width": width, "stroke-dasharray": dash, opacity: width > 4 ? 0.5 : 1 };
    return el("li", {}, svg("svg", { "aria-hidden": "true" }, svg("path", stroke)), name);
  });
  if (store.roles.magnets) items.push(...magnetsOfLegend());
  $("legend").replaceChildren(...items);
}

function magnetsOfLegend() {
  const dot = { cx: 12, cy: 5, r: 2, fill: "var(--magnet)" };
  const ring = { cx: 12, cy: 5, r: 5, fill: "none", stroke: "var(--hit)", "stroke-width": 1.6 };
  return [
    el("li", {}, svg("svg", { "aria-hidden": "true" }, svg("circle", dot)), "magnet"),
    el("li", {}, svg("svg", { "aria-hidden": "true" }, svg("circle", dot), svg("circle", ring)), "seen"),
  ];
}

function showView() {
  $("fit").setAttribute("aria-pressed", String(map.mode === "fit"));
  $("follow").setAttribute("aria-pressed", String(map.mode === "follow"));
}

const isStale = (sample) => store.held === null && sample?.age > STALE_S;
const tiltOf = (frame) => (isStale(frame.attitude) ? undefined : frame.tilt);
const yawOf = (frame) => frame.pose?.yaw ?? tiltOf(frame)?.yaw ?? frame.best?.yaw;

function showPose(frame) {
  const { best, pose, attitude } = frame;
  const tilt = tiltOf(frame);
  put($("x"), fixed(best?.x, 4));
  put($("y"), fixed(best?.y, 4));
  put($("yaw"), best ? fixed(degrees(wrapped(best.yaw)), 1) : NONE);
  put($("bound"), frame.ellipse ? fixed(frame.ellipse.a * 1e3, 1) : NONE);
  put($("error"), frame.error === undefined ? NONE : fixed(frame.error * 1e3, 1));
  $("pose").dataset.seq = best?.seq ?? "";
  const stale = isStale(best);
  const ambiguous = pose?.ambiguous ? "\u25b2 ambiguous" : "";
  put($("flag"), stale ? `\u25b2 no pose for ${fixed(best.age, 0)} s` : ambiguous);
  put($("roll"), tilt ? fixed(degrees(tilt.roll), 1) : NONE);
  put($("pitch"), tilt ? fixed(degrees(tilt.pitch), 1) : NONE);
  const yaw = yawOf(frame);
  put($("heading"), yaw === undefined ? NONE : fixed((450 - degrees(wrapped(yaw))) % 360, 0));
  put($("heading-word"), attitude?.disturbed ? "\u25b2 disturbed" : "heading");
  $("heading-word").classList.toggle("flag", Boolean(attitude?.disturbed));
}

function showStatus() {
  if (!store.scene) return;
  graph.draw(store);
  table.draw(store);
  if (detail.dialog.open) detail.draw(store);
  const status = store.shownStatus;
  const all = nodesOf(store.scene, status).map((name) => healthOf(name, store.scene, status));
  const count = (level) => all.filter((health) => health.level === level).length;
  const words = [["good", "fine"], ["warn", "with a warning"], ["bad", "failing"]]
    .map(([level, word]) => [count(level), word]).filter(([many]) => many).map(([many, word]) => `${many} ${word}`);
  const cpu = Object.values(status?.nodes ?? {}).reduce((total, said) => total + said.cpu, 0);
  const live = document.documentElement.dataset.state === "live";
  put($("summary"), live ? `${all.length} nodes: ${words.join(", ")} \u00b7 ${fixed(cpu * 100, 0)} % of a core` : "");
  put($("uptime"), status ? `up ${duration(status.at - store.scene.started)}` : "");
}

function showHeld() {
  const back = store.held === null ? 0 : store.newest.at - store.held;
  $("pause").setAttribute("aria-pressed", String(store.held !== null));
  put($("pause"), store.held === null ? "Pause" : "Go on");
  put($("when"), store.held === null ? "now" : back < 0.05 ? "paused" : `\u2212${fixed(back, 1)} s`);
  $("scrub").value = String(-back);
  $("scrub").setAttribute("aria-valuetext", store.held === null ? "now" : `${fixed(back, 1)} seconds ago`);
}

function hold(back) {
  store.hold(back);
  showHeld();
  showStatus();
  redraw();
}

let plotted = 0;
function draw(time) {
  requestAnimationFrame(draw);
  if (!dirty) return;
  dirty = false;
  const frame = store.shown;
  map.draw(store);
  closeUp.avoid(map.robotAt);
  closeUp.draw(frame);
  if (frame) {
    showPose(frame);
    horizon.draw(tiltOf(frame));
    compass.draw(yawOf(frame), frame.ellipse?.yaw ?? frame.attitude?.heading_std);
  }
  if (store.held !== null) showHeld();
  if (time - plotted >= PLOTS_MS) {
    plotted = time;
    plots.draw(store);
  } else if (store.held !== null) dirty = true;
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  readColours();
  redraw();
}

const dark = matchMedia("(prefers-color-scheme: dark)");
const chosen = () => localStorage.getItem("theme");
setTheme(chosen() ?? (dark.matches ? "dark" : "light"));
dark.addEventListener("change", () => chosen() || setTheme(dark.matches ? "dark" : "light"));
$("theme").addEventListener("click", () => {
  const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  localStorage.setItem("theme", theme);
  setTheme(theme);
});

$("zoom-in").addEventListener("click", () => map.zoom(1.4));
$("zoom-out").addEventListener("click", () => map.zoom(1 / 1.4));
$("fit").addEventListener("click", () => map.setMode("fit"));
$("follow").addEventListener("click", () => map.setMode("follow"));
$("pause").addEventListener("click", () => (store.held === null ? hold(0.001) : hold(0)));
$("scrub").addEventListener("input", (event) => hold(-Number(event.target.value)));
document.addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, dialog, [role=button]")) return;
  event.preventDefault();
  $("pause").click();
});

const tabs = [...document.querySelectorAll("[role=tab]")];
function choose(tab) {
  for (const other of tabs) {
    const on = other === tab;
    other.setAttribute("aria-selected", String(on));
    other.tabIndex = on ? 0 : -1;
    $(other.getAttribute("aria-controls")).hidden = !on;
  }
  log.toEnd();
}
tabs.forEach((tab, i) => {
  tab.addEventListener("click", () => choose(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    const next = tabs[(i + step + tabs.length) % tabs.length];
    choose(next);
    next.focus();
  });
});

requestAnimationFrame(draw);
