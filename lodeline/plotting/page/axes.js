// Axes: ticks at round numbers, curves thinned to what a screen can show, boxes that tell values.

const LEFT = 68; // px for the numbers of an upright axis and its name

// Round numbers from low to high, about one for each `gap` of the `length` pixels.
function roundTicks(low, high, length, gap) {
  const most = ((high - low) * gap) / Math.max(length, 1);
  const power = 10 ** Math.floor(Math.log10(most));
  const step = [1, 2, 5, 10].map((n) => n * power).find((s) => s >= most * (1 - 1e-9));
  const ticks = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n += 1) ticks.push(n * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return { ticks, text: (value) => fixed(value, digits) };
}

// Powers of ten; where there are few of them, also twice and five times these.
function logTicks(low, high) {
  const ticks = [];
  const decades = Math.log10(high) - Math.log10(low);
  const every = Math.max(1, Math.ceil(decades / 6));
  const parts = decades < 2.5 ? [1, 2, 5] : [1];
  for (let n = Math.floor(Math.log10(low)); n <= Math.log10(high); n += every) {
    for (const part of parts) {
      const tick = part * 10 ** n;
      if (tick >= low && tick <= high) ticks.push(tick);
    }
  }
  return { ticks, text: (value) => String(Number(value.toPrecision(1))) };
}

// Index of the last of the sorted values that is not above `value`; -1 if all are.
function lastUpTo(values, value) {
  let [low, high] = [0, values.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function meaningful(value) {
  const size = Math.abs(value);
  return fixed(value, size >= 100 ? 1 : size >= 1 ? 2 : size >= 0.01 || size === 0 ? 3 : 5);
}

// A line over sorted x: of all that falls into one pixel, its first, least, greatest and last.
function strokeCurve(c, xs, ys, from, to, px, py) {
  c.beginPath();
  let open = false;
  let column = null;
  const flush = () => {
    if (!column) return;
    for (const y of [column.first, column.low, column.high, column.last]) {
      if (open) c.lineTo(column.x, py(y));
      else c.moveTo(column.x, py(y));
      open = true;
    }
    column = null;
  };
  for (let i = from; i <= to; i += 1) {
    const y = ys[i];
    if (Number.isNaN(y)) {
      flush();
      open = false;
      continue;
    }
    const x = px(xs[i]);
    if (column && Math.abs(x - column.x) < 0.5) {
      column.low = Math.min(column.low, y);
      column.high = Math.max(column.high, y);
      column.last = y;
      continue;
    }
    flush();
    column = { x, first: y, low: y, high: y, last: y };
  }
  flush();
  c.stroke();
}

// A box with one line for each [colour, text], beside x, within the drawing.
function tellBox(c, lines, x, top, left, right) {
  if (!lines.length) return;
  c.font = `12px ${FONT}`;
  const wide = Math.max(...lines.map(([, text]) => c.measureText(text).width)) + 26;
  const high = lines.length * 16 + 6;
  const at = x + 12 + wide > right ? Math.max(left, x - 12 - wide) : x + 12;
  c.globalAlpha = 0.92;
  c.fillStyle = colours.raised;
  c.strokeStyle = colours.line;
  c.lineWidth = 1;
  c.beginPath();
  c.roundRect(at, top, wide, high, 5);
  c.fill();
  c.stroke();
  c.globalAlpha = 1;
  c.textAlign = "left";
  lines.forEach(([colour, text], i) => {
    c.fillStyle = colours[colour];
    c.fillRect(at + 8, top + 9 + i * 16, 8, 3);
    c.fillStyle = colours.ink;
    c.fillText(text, at + 20, top + 15 + i * 16);
  });
}

// The legend: one button for each name, which shows or hides all that bears it.
function legend(items, hidden, changed) {
  const bar = el("div", { class: "legend" });
  const seen = new Set();
  for (const { name, colour, mark } of items) {
    if (seen.has(name)) continue;
    seen.add(name);
    const stroke = { stroke: `var(--${colour})`, fill: "none", "stroke-width": 2 };
    const shapes = {
      line: ["path", { ...stroke, d: "M0 5H20" }],
      thick: ["path", { ...stroke, "stroke-width": 6, "stroke-opacity": 0.45, d: "M0 5H20" }],
      dash: ["path", { ...stroke, "stroke-dasharray": "6 3", d: "M0 5H20" }],
      dots: ["circle", { cx: 10, cy: 5, r: 3, fill: `var(--${colour})` }],
      ring: ["circle", { ...stroke, "stroke-width": 1.5, cx: 10, cy: 5, r: 4 }],
      cross: ["path", { ...stroke, "stroke-width": 1.3, d: "M6 5H14M10 1V9" }],
      band: ["rect", { width: 20, height: 10, rx: 2, fill: `var(--${colour})`, "fill-opacity": 0.25 }],
    };
    const button = el("button", { type: "button", "aria-pressed": "true", title: "show or hide" });
    button.append(svg("svg", { viewBox: "0 0 20 10", "aria-hidden": "true" }, svg(...shapes[mark])), name);
    button.addEventListener("click", () => {
      if (!hidden.delete(name)) hidden.add(name);
      button.setAttribute("aria-pressed", String(!hidden.has(name)));
      changed();
    });
    bar.append(button);
  }
  return bar;
}
