// Plots over time. All of them show the same stretch of it, and the same moment under the pointer.

const time = {
  full: [0, 1],
  view: [0, 1],
  cursor: null,
  charts: [],
  show(low, high) {
    const [first, last] = this.full;
    const span = Math.min(last - first, Math.max(high - low, (last - first) * 1e-5));
    const from = Math.min(Math.max(low, first), last - span);
    this.view = [from, from + span];
    this.redraw();
  },
  zoom(factor, about) {
    const [low, high] = this.view;
    this.show(about - (about - low) * factor, about + (high - about) * factor);
  },
  shift(by) {
    const [low, high] = this.view;
    this.show(low + by * (high - low), high + by * (high - low));
  },
  point(at) {
    this.cursor = at;
    this.redraw();
  },
  redraw() {
    for (const chart of this.charts) chart.wish();
  },
};

// What both kinds of charts share: the card, and drawing once a frame while on the screen.
class Card {
  constructor(figure, items, extra = "") {
    this.figure = figure;
    this.hidden = new Set();
    this.canvas = el("canvas", { tabindex: "0", role: "img", "aria-label": `${figure.title}: ${figure.note}` });
    this.element = el(
      "section", { class: `card ${extra}`, id: figure.kind, "data-panels": String(figure.panels.length) },
      el("h2", {}, figure.title), el("p", {}, figure.note),
      legend(items, this.hidden, () => this.wish()), el("div", { class: "place" }, this.canvas),
    );
    this.surface = new Surface(this.canvas, () => this.wish());
    this.visible = false;
    new IntersectionObserver((entries) => {
      this.visible = entries.at(-1).isIntersecting;
      this.wish();
    }).observe(this.canvas);
    this.pointers = new Map();
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    for (const name of ["pointerup", "pointercancel"]) {
      this.canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
  }

  wish() {
    if (this.wished || !this.visible) return;
    this.wished = true;
    requestAnimationFrame(() => {
      this.wished = false;
      const c = this.surface.begin();
      if (c) this.draw(c);
    });
  }

  key(event) {
    const middle = time.cursor ?? (time.view[0] + time.view[1]) / 2;
    const deeds = {
      ArrowLeft: () => time.shift(-0.1),
      ArrowRight: () => time.shift(0.1),
      "+": () => time.zoom(0.7, middle),
      "-": () => time.zoom(1 / 0.7, middle),
      0: () => time.show(...time.full),
    };
    if (!deeds[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    deeds[event.key]();
  }
}

const markOf = (curve) => (curve.style === "dots" ? "dots" : curve.faint ? "thick" : curve.dashed ? "dash" : "line");

class TimeChart extends Card {
  constructor(figure) {
    super(figure, figure.panels.flatMap((panel) => [
      ...panel.curves.map((each) => ({ ...each, mark: markOf(each) })),
      ...panel.bands.map((each) => ({ ...each, mark: "band" })),
      ...panel.limits.map((each) => ({ ...each, colour: "bad", mark: "dash" })),
    ]));
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => this.up());
    canvas.addEventListener("pointerleave", () => time.point(null));
    canvas.addEventListener("dblclick", () => time.show(...time.full));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  get left() { return LEFT; }
  get right() { return this.surface.width - 10; }

  timeAt(x) {
    const [low, high] = time.view;
    return low + ((x - this.left) / (this.right - this.left)) * (high - low);
  }

  down(event) {
    if (event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event.offsetX);
    this.panning = event.shiftKey || event.pointerType === "touch";
    this.stretch = this.panning ? null : [event.offsetX, event.offsetX];
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (before !== undefined) {
      const now = event.offsetX;
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
      this.pointers.set(event.pointerId, now);
      if (other !== undefined) {
        const factor = Math.abs(before - other) / Math.max(1, Math.abs(now - other));
        time.zoom(Math.min(2, Math.max(0.5, factor)), this.timeAt((now + other) / 2));
      } else if (this.panning) time.shift((before - now) / (this.right - this.left));
      else if (this.stretch) this.stretch[1] = now;
    }
    const inside = event.offsetX >= this.left && event.offsetX <= this.right;
    time.point(inside ? this.timeAt(event.offsetX) : null);
  }

  up() {
    const stretch = this.stretch;
    this.stretch = null;
    if (stretch && Math.abs(stretch[1] - stretch[0]) > 5) {
      const [low, high] = [...stretch].sort((a, b) => a - b).map((x) => this.timeAt(x));
      time.show(low, high);
    }
    this.wish();
  }

  wheel(event) {
    if (event.ctrlKey || event.metaKey) time.zoom(Math.exp(event.deltaY * 0.002), this.timeAt(event.offsetX));
    else if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) time.shift(event.deltaX / (this.right - this.left));
    else return; // the page scrolls
    event.preventDefault();
  }

  draw(c) {
    const { left, right } = this;
    const bottom = this.surface.height - 30;
    const [low, high] = time.view;
    const px = (t) => left + ((t - low) / (high - low)) * (right - left);
    const panels = this.figure.panels;
    const each = (bottom - 4 + 14) / panels.length;
    const scale = roundTicks(low, high, right - left, 90);
    panels.forEach((panel, i) => {
      const box = { left, right, top: 4 + i * each, bottom: 4 + (i + 1) * each - 14 };
      this.panel(c, panel, box, px, scale);
    });
    c.font = `12px ${FONT}`;
    c.fillStyle = colours["ink-3"];
    c.textAlign = "center";
    for (const tick of scale.ticks) c.fillText(scale.text(tick), px(tick), bottom + 14);
    c.textAlign = "right";
    c.fillStyle = colours["ink-2"];
    c.fillText(time.cursor === null ? "time [s]" : `t = ${fixed(time.cursor, 3)} s`, right, bottom + 28);
    if (this.stretch) {
      c.fillStyle = colours.ekf;
      c.globalAlpha = 0.14;
      c.fillRect(this.stretch[0], 4, this.stretch[1] - this.stretch[0], bottom - 4);
      c.globalAlpha = 1;
    }
  }

  panel(c, panel, box, px, scale) {
    const shown = (things) => things.filter((thing) => !this.hidden.has(thing.name));
    const [curves, bands, limits] = [panel.curves, panel.bands, panel.limits].map(shown);
    const range = panel.rows.length ? [0.4, panel.rows.length + 0.6] : rangeOf(panel, curves, bands, limits);
    const way = panel.log ? Math.log10 : (value) => value;
    const [low, high] = range.map(way);
    const floor = panel.log ? range[0] : -Infinity;
    const py = (y) => box.bottom - ((way(Math.max(y, floor)) - low) / (high - low)) * (box.bottom - box.top);
    this.frame(c, panel, box, px, py, range, scale);
    c.save();
    c.beginPath();
    c.rect(box.left, box.top - 2, box.right - box.left, box.bottom - box.top + 4);
    c.clip();
    for (const band of bands) fillBand(c, band, px, py);
    for (const limit of limits) {
      c.strokeStyle = colours.bad;
      c.lineWidth = 1.2;
      c.setLineDash([5, 4]);
      c.beginPath();
      c.moveTo(box.left, py(limit.value));
      c.lineTo(box.right, py(limit.value));
      c.stroke();
      c.setLineDash([]);
    }
    for (const curve of curves) drawCurve(c, curve, px, py);
    c.fillStyle = colours.ekf;
    for (const [row, begin, end] of panel.spans) {
      c.fillRect(px(begin), py(row + 0.36), Math.max(1, px(end) - px(begin)), py(row - 0.36) - py(row + 0.36));
    }
    c.restore();
    if (time.cursor !== null) this.tell(c, panel, curves, box, px, py);
  }

  frame(c, panel, box, px, py, range, scale) {
    c.lineWidth = 1;
    c.strokeStyle = colours.grid;
    c.font = `12px ${FONT}`;
    c.fillStyle = colours["ink-3"];
    c.textAlign = "right";
    const rows = panel.rows.length && { ticks: panel.rows.map((_, i) => i + 1), text: (row) => panel.rows[row - 1] };
    const ticks = rows || (panel.log ? logTicks(...range) : roundTicks(...range, box.bottom - box.top, 34));
    c.beginPath();
    for (const tick of ticks.ticks) {
      const y = Math.round(py(tick)) + 0.5;
      c.moveTo(box.left, y);
      c.lineTo(box.right, y);
      c.fillText(ticks.text(tick), box.left - 6, y + 4);
    }
    for (const tick of scale.ticks) {
      const x = Math.round(px(tick)) + 0.5;
      c.moveTo(x, box.top);
      c.lineTo(x, box.bottom);
    }
    c.stroke();
    c.strokeStyle = colours["ink-3"];
    c.beginPath();
    c.moveTo(box.left + 0.5, box.top);
    c.lineTo(box.left + 0.5, box.bottom + 0.5);
    c.lineTo(box.right, box.bottom + 0.5);
    c.stroke();
    c.save();
    c.translate(12, (box.top + box.bottom) / 2);
    c.rotate(-Math.PI / 2);
    c.textAlign = "center";
    c.fillStyle = colours["ink-2"];
    c.fillText(panel.unit ? `${panel.label} [${panel.unit}]` : panel.label, 0, 0);
    c.restore();
  }

  // A line at the moment under the pointer, and what each curve was then.
  tell(c, panel, curves, box, px, py) {
    const x = px(time.cursor);
    if (x < box.left || x > box.right) return;
    c.strokeStyle = colours["ink-3"];
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(Math.round(x) + 0.5, box.top);
    c.lineTo(Math.round(x) + 0.5, box.bottom);
    c.stroke();
    const lines = [];
    for (const curve of curves) {
      const i = nearest(curve.x, time.cursor);
      if (i < 0 || Number.isNaN(curve.y[i]) || Math.abs(px(curve.x[i]) - x) > 24) continue;
      lines.push([curve.colour, `${curve.name}  ${meaningful(curve.y[i])}${panel.unit && panel.unit !== "1" ? ` ${panel.unit}` : ""}`]);
      c.fillStyle = colours[curve.colour];
      c.beginPath();
      c.arc(px(curve.x[i]), py(curve.y[i]), 3.2, 0, 7);
      c.fill();
    }
    const closed = panel.spans.filter(([, begin, end]) => begin <= time.cursor && time.cursor < end);
    if (closed.length) lines.push(["ekf", `closed: ${closed.map(([row]) => row).join(", ")}`]);
    tellBox(c, lines, x, box.top + 4, box.left, box.right);
  }
}

function nearest(values, value) {
  const i = lastUpTo(values, value);
  return i + 1 < values.length && (i < 0 || values[i + 1] - value < value - values[i]) ? i + 1 : i;
}

// Indices of the points to draw for the stretch that is shown: one more on either side.
function stretchOf(xs) {
  return [Math.max(0, lastUpTo(xs, time.view[0])), Math.min(xs.length - 1, lastUpTo(xs, time.view[1]) + 1)];
}

// From the least to the greatest that is seen in this stretch, with some air.
function rangeOf(panel, curves, bands, limits) {
  let [low, high] = [Infinity, -Infinity];
  const take = (xs, ys) => {
    const [from, to] = stretchOf(xs);
    for (let i = from; i <= to; i += 1) {
      const y = ys[i];
      if (panel.log ? !(y > 0) : Number.isNaN(y)) continue;
      if (y < low) low = y;
      if (y > high) high = y;
    }
  };
  for (const curve of curves) take(curve.x, curve.y);
  for (const band of bands) [band.low, band.high].forEach((side) => take(band.x, side));
  for (const { value } of limits) [low, high] = [Math.min(low, value), Math.max(high, value)];
  if (!(low <= high)) return panel.log ? [0.1, 10] : [-1, 1];
  if (panel.log) return [Math.max(low / 1.3, high * 1e-6), high * 1.3];
  const pad = (high - low) * 0.07 || Math.abs(high) * 0.1 || 1;
  return [low - pad, high + pad];
}

function drawCurve(c, curve, px, py) {
  const [from, to] = stretchOf(curve.x);
  c.strokeStyle = c.fillStyle = colours[curve.colour];
  if (curve.style === "dots") {
    const radius = curve.faint ? 1.4 : 2.2;
    c.globalAlpha = curve.faint ? 0.4 : 0.9;
    c.beginPath();
    for (let i = from; i <= to; i += 1) {
      if (Number.isNaN(curve.y[i])) continue;
      const [x, y] = [px(curve.x[i]), py(curve.y[i])];
      c.moveTo(x + radius, y);
      c.arc(x, y, radius, 0, 7);
    }
    c.fill();
    c.globalAlpha = 1;
    return;
  }
  c.lineJoin = "round";
  c.lineWidth = curve.faint ? 5 : 1.6;
  c.globalAlpha = curve.faint ? 0.4 : 1;
  c.setLineDash(curve.dashed ? [7, 3] : []);
  strokeCurve(c, curve.x, curve.y, from, to, px, py);
  c.setLineDash([]);
  c.globalAlpha = 1;
}

function fillBand(c, band, px, py) {
  const [from, to] = stretchOf(band.x);
  c.fillStyle = colours[band.colour];
  c.globalAlpha = 0.16;
  c.beginPath();
  for (let i = from; i <= to; i += 1) c.lineTo(px(band.x[i]), py(band.low[i]));
  for (let i = to; i >= from; i -= 1) c.lineTo(px(band.x[i]), py(band.high[i]));
  c.fill();
  c.globalAlpha = 1;
}
