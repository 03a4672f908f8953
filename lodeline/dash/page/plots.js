// Time plots of the last minute: small, all of one kind, all with the same time below them.

import { FONT, NONE, Surface, colours, degrees, el, fixed, wrapped } from "./dom.js";

const SPAN_S = 60;
const LEAST_S = 10; // of a run that has just begun
const EDGE = { left: 36, right: 6, top: 20, bottom: 14 };

const mm = (metres) => (metres === undefined ? undefined : metres * 1e3);
const angle = (radians) => (radians === undefined ? undefined : degrees(wrapped(radians)));

// Each plot: title, unit, digits, series [name, colour, dash, value of a frame].
function plotsOf(roles, gate) {
  const all = [
    roles.pose && {
      title: "x, y", unit: "m", digits: 3,
      series: [["x", "ekf", [], (f) => f.pose?.x], ["y", "hit", [5, 3], (f) => f.pose?.y]],
    },
    (roles.pose || roles.attitude) && {
      title: "Heading", unit: "\u00b0", digits: 1, low: -180, high: 180, turns: 360,
      series: [
        roles.attitude && ["att", "odom", [5, 3], (f) => angle(f.tilt?.yaw)],
        roles.pose && ["EKF", "ekf", [], (f) => angle(f.pose?.yaw)],
      ],
    },
    roles.truth && {
      title: "Error", unit: "mm", digits: 1, log: true, low: 0.1, high: 100,
      series: [["odom", "odom", [5, 3], (f) => mm(f.drift)], roles.pose && ["EKF", "ekf", [], (f) => mm(f.error)]],
    },
    roles.pose && {
      title: "95 %", unit: "mm", digits: 1, low: 0,
      series: [["long", "ekf", [], (f) => mm(f.ellipse?.a)], ["short", "hit", [5, 3], (f) => mm(f.ellipse?.b)]],
    },
    roles.pose && {
      title: "\u03c3 yaw", unit: "\u00b0", digits: 2, low: 0,
      series: [
        ["EKF", "ekf", [], (f) => f.ellipse && degrees(f.ellipse.yaw)],
        roles.attitude && ["att", "odom", [5, 3], (f) => f.attitude && degrees(f.attitude.heading_std)],
      ],
    },
    roles.pose && {
      title: "NIS", unit: "", digits: 1, low: 0, high: gate * 1.25, limit: gate, dots: true,
      series: [["magnets", "ekf", [], (f) => f.pose?.nis]],
    },
    roles.odom && {
      title: "Speed", unit: "m/s", digits: 3,
      series: [["v", "odom", [], (f) => f.odom?.v]],
    },
    roles.odom && {
      title: "Yaw rate", unit: "\u00b0/s", digits: 1,
      series: [["w", "odom", [], (f) => f.odom && degrees(f.odom.w)]],
    },
  ];
  return all.filter(Boolean).map((plot) => ({ ...plot, series: plot.series.filter(Boolean) }));
}

export class Plots {
  constructor(place) {
    this.place = place;
    this.plots = [];
  }

  begin(store) {
    this.place.replaceChildren();
    this.plots = store.scene ? plotsOf(store.roles, store.scene.floor.gate) : [];
    for (const plot of this.plots) {
      const canvas = el("canvas", { role: "img", "aria-label": `${plot.title} over the last minute` });
      this.place.append(el("figure", {}, canvas));
      plot.surface = new Surface(canvas);
    }
  }

  draw(store) {
    for (const plot of this.plots) drawPlot(plot, store);
  }
}

function drawPlot(plot, store) {
  const c = plot.surface.begin();
  if (!c) return;
  const box = {
    left: EDGE.left,
    right: plot.surface.width - EDGE.right,
    top: EDGE.top,
    bottom: plot.surface.height - EDGE.bottom,
  };
  const rows = valuesOf(plot, store.frames);
  const range = rangeOf(plot, rows);
  const place = plot.log ? Math.log10 : (value) => value;
  const [low, high] = range.map(place);
  const y = (value) => box.bottom - ((place(value) - low) / (high - low)) * (box.bottom - box.top);
  const end = store.newest?.at ?? 0;
  const span = Math.min(SPAN_S, Math.max(LEAST_S, Math.ceil(end - (store.frames[0]?.at ?? end))));
  const x = (at) => box.right - ((end - at) / span) * (box.right - box.left);
  axes(c, plot, box, range, x, y, end, span);
  c.save();
  c.beginPath();
  c.rect(box.left, box.top - 1, box.right - box.left, box.bottom - box.top + 2);
  c.clip();
  plot.series.forEach((series, i) => line(c, plot, series, rows[i], store.frames, x, y, range));
  c.restore();
  if (store.held !== null) cursor(c, x(store.held), box);
  title(c, plot, store.shown, box);
}

function valuesOf(plot, frames) {
  return plot.series.map(([, , , value]) => frames.map(value));
}

function rangeOf(plot, rows) {
  let low = plot.low ?? Infinity;
  let high = plot.high ?? -Infinity;
  if (plot.turns) return [low, high];
  for (const row of rows) {
    for (const value of row) {
      if (value === undefined || value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (!(low <= high)) return [0, 1];
  if (plot.log) return [Math.max(0.05, Math.min(low, plot.low)), high * 1.3];
  const pad = Math.max((high - low) * 0.12, 10 ** -plot.digits * 4);
  return [plot.low ?? low - pad, plot.high !== undefined && high <= plot.high ? high : high + pad];
}

function ticksOf(plot, [low, high]) {
  if (plot.turns) return [-180, 0, 180];
  if (plot.log) return [0.1, 1, 10, 100, 1000, 10000].filter((t) => t >= low && t <= high);
  const most = (high - low) / 2; // so that there are at least two
  const power = 10 ** Math.floor(Math.log10(most));
  const step = [5, 2, 1].map((n) => n * power).find((s) => s <= most * (1 + 1e-9)) ?? power;
  const ticks = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n += 1) ticks.push(n * step);
  return ticks;
}

function axes(c, plot, box, range, x, y, end, span) {
  c.lineWidth = 1;
  c.strokeStyle = colours.grid;
  c.fillStyle = colours["ink-3"];
  c.font = `10.5px ${FONT}`;
  c.textAlign = "right";
  c.beginPath();
  const ticks = ticksOf(plot, range);
  const gap = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) : 1;
  const digits = plot.log ? 0 : Math.max(0, Math.min(4, Math.ceil(-Math.log10(gap) - 1e-9)));
  for (const tick of ticks) {
    const at = Math.round(y(tick)) + 0.5;
    c.moveTo(box.left, at);
    c.lineTo(box.right, at);
    c.fillText(plot.log && tick < 1 ? String(tick) : fixed(tick, digits), box.left - 4, at + 3.5);
  }
  const step = [2, 5, 10, 20].find((s) => span / s <= 5.5) ?? 20;
  const backs = [...Array(Math.floor(span / step) + 1).keys()].map((n) => n * step);
  for (const back of backs) {
    const at = Math.round(x(end - back)) + 0.5;
    c.moveTo(at, box.top);
    c.lineTo(at, box.bottom);
  }
  c.stroke();
  for (const back of backs.filter((b) => b > 0 && b < span * 0.95)) {
    c.textAlign = "center";
    c.fillText(`\u2212${back} s`, x(end - back), box.bottom + 11);
  }
  if (plot.limit !== undefined) {
    c.strokeStyle = colours.bad;
    c.setLineDash([4, 3]);
    c.beginPath();
    c.moveTo(box.left, y(plot.limit));
    c.lineTo(box.right, y(plot.limit));
    c.stroke();
    c.setLineDash([]);
    c.fillStyle = colours.bad;
    c.textAlign = "left";
    c.fillText(`gate ${fixed(plot.limit, 2)}`, box.left + 3, y(plot.limit) - 3);
  }
}

function line(c, plot, [, colour, dash], values, frames, x, y, range) {
  c.strokeStyle = c.fillStyle = colours[colour];
  c.lineWidth = 1.7;
  c.lineJoin = "round";
  if (plot.dots) return dots(c, plot, values, frames, x, y);
  c.setLineDash(dash);
  c.beginPath();
  let last;
  let column; // what falls into one pixel is drawn as its first, least, greatest and last
  const flush = () => {
    if (!column) return;
    for (const value of [column.first, column.low, column.high, column.last]) c.lineTo(column.x, y(value));
    column = undefined;
  };
  values.forEach((value, i) => {
    if (value === undefined || value === null) {
      flush();
      last = undefined;
      return;
    }
    const shown = plot.log ? Math.max(value, range[0]) : value;
    const px = Math.round(x(frames[i].at));
    const broken = last === undefined || (plot.turns && Math.abs(value - last) > plot.turns / 2);
    if (broken) {
      flush();
      c.moveTo(px, y(shown));
    }
    if (column?.x !== px) {
      flush();
      column = { x: px, first: shown, low: shown, high: shown };
    }
    column.low = Math.min(column.low, shown);
    column.high = Math.max(column.high, shown);
    column.last = shown;
    last = value;
  });
  flush();
  c.stroke();
  c.setLineDash([]);
}

// One mark for each measurement: the value stays as it is until the next one. What is beyond
// the gate is a cross.
function dots(c, plot, values, frames, x, y) {
  c.beginPath();
  values.forEach((value, i) => {
    if (value === undefined || (i && value === values[i - 1])) return;
    const [px, py] = [x(frames[i].at), y(value)];
    if (value <= plot.limit) c.rect(px - 1, py - 1, 2, 2);
    else {
      c.moveTo(px - 3, py - 3);
      c.lineTo(px + 3, py + 3);
      c.moveTo(px - 3, py + 3);
      c.lineTo(px + 3, py - 3);
    }
  });
  c.stroke();
}

function cursor(c, x, box) {
  c.strokeStyle = colours.ink;
  c.lineWidth = 1;
  c.beginPath();
  c.moveTo(x, box.top - 2);
  c.lineTo(x, box.bottom);
  c.stroke();
}

// Title and unit on the left; on the right each series in its colour with its value now.
function title(c, plot, frame, box) {
  c.font = `600 12px ${FONT}`;
  c.textAlign = "left";
  c.fillStyle = colours.ink;
  c.fillText(plot.title, 4, 12);
  const wide = c.measureText(plot.title).width;
  c.font = `11px ${FONT}`;
  c.fillStyle = colours["ink-3"];
  c.fillText(plot.unit, 8 + wide, 12);
  let right = box.right;
  for (const [name, colour, dash, value] of [...plot.series].reverse()) {
    const now = frame && value(frame);
    const text = `${name} ${now === undefined || now === null ? NONE : fixed(now, Math.abs(now) >= 100 ? Math.max(0, plot.digits - 1) : plot.digits)}`;
    c.font = `11px ${FONT}`;
    c.textAlign = "right";
    c.fillStyle = colours[colour];
    c.fillText(text, right, 12);
    const start = right - c.measureText(text).width - 14;
    c.strokeStyle = colours[colour];
    c.lineWidth = 2;
    c.setLineDash(dash.length ? [4, 2] : []);
    c.beginPath();
    c.moveTo(start, 8);
    c.lineTo(start + 11, 8);
    c.stroke();
    c.setLineDash([]);
    right = start - 6;
  }
}
