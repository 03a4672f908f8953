// The floor from above: both axes to one scale. What lies outside the stretch of time is pale.

class FloorChart extends Card {
  constructor(figure) {
    const { floor } = figure;
    super(figure, [
      ...floor.trails.map((each) => ({ ...each, mark: markOf(each) })),
      ...(floor.ellipses.length ? [{ name: "95 %", colour: "ink", mark: "ring" }] : []),
      ...(floor.magnets.x.length ? [{ name: "magnets", colour: "magnet", mark: "dots" }] : []),
      ...(floor.seen.x.length ? [{ name: "magnets met", colour: "hit", mark: "ring" }] : []),
      ...(floor.hits.x.length ? [{ name: "where they were seen", colour: "hit", mark: "cross" }] : []),
    ], "floor");
    this.fitted = true;
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerleave", () => time.point(null));
    canvas.addEventListener("dblclick", () => {
      this.fitted = true;
      time.show(...time.full);
    });
  }

  get box() {
    return { left: LEFT, right: this.surface.width - 10, top: 6, bottom: this.surface.height - 34 };
  }

  fit() {
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const { x, y } of [...this.figure.floor.trails, this.figure.floor.seen]) {
      for (let i = 0; i < x.length; i += 1) {
        if (Number.isNaN(y[i])) continue;
        west = Math.min(west, x[i]);
        east = Math.max(east, x[i]);
        south = Math.min(south, y[i]);
        north = Math.max(north, y[i]);
      }
    }
    const { left, right, top, bottom } = this.box;
    const least = 0.05; // m: a robot at rest still has a place
    this.scale = 0.92 * Math.min((right - left) / Math.max(east - west, least), (bottom - top) / Math.max(north - south, least));
    this.centre = [(west + east) / 2, (south + north) / 2];
  }

  wheel(event) {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * 0.002), event.offsetX, event.offsetY);
  }

  // The floor under (px, py) stays where it is.
  zoom(factor, px, py) {
    const { left, right, top, bottom } = this.box;
    const scale = this.scale * factor;
    this.centre[0] += (px - (left + right) / 2) * (1 / this.scale - 1 / scale);
    this.centre[1] -= (py - (top + bottom) / 2) * (1 / this.scale - 1 / scale);
    this.scale = scale;
    this.fitted = false;
    this.wish();
  }

  move(event) {
    const now = [event.offsetX, event.offsetY];
    const before = this.pointers.get(event.pointerId);
    if (!before) {
      this.point(...now);
      return;
    }
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    if (other) {
      const length = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      this.zoom(length(now) / Math.max(1, length(before)), other[0], other[1]);
    } else if (event.pointerType !== "touch") {
      this.centre[0] -= (now[0] - before[0]) / this.scale;
      this.centre[1] += (now[1] - before[1]) / this.scale;
      this.fitted = false;
      this.wish();
    }
  }

  // The moment at which a trail came closest to the pointer, if it came close.
  point(px, py) {
    let [least, at] = [24, null];
    for (const { name, x, y, t } of this.figure.floor.trails) {
      if (this.hidden.has(name)) continue;
      for (let i = 0; i < x.length; i += 1) {
        const length = Math.hypot(this.x(x[i]) - px, this.y(y[i]) - py);
        if (length < least) [least, at] = [length, t[i]];
      }
    }
    time.point(at);
  }

  draw(c) {
    if (this.fitted) this.fit();
    const box = this.box;
    this.x = (x) => (box.left + box.right) / 2 + (x - this.centre[0]) * this.scale;
    this.y = (y) => (box.top + box.bottom) / 2 - (y - this.centre[1]) * this.scale;
    this.frame(c, box);
    c.save();
    c.beginPath();
    c.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
    c.clip();
    const { floor } = this.figure;
    if (!this.hidden.has("magnets")) this.dots(c, floor.magnets, "magnet", Math.min(3, Math.max(1, this.scale * 0.002)));
    for (const trail of floor.trails) if (!this.hidden.has(trail.name)) this.trail(c, trail);
    if (!this.hidden.has("95 %")) this.ellipses(c, floor.ellipses);
    if (!this.hidden.has("where they were seen")) this.crosses(c, floor.hits);
    if (!this.hidden.has("magnets met")) this.rings(c, floor.seen);
    const main = floor.trails.at(-1);
    if (!this.hidden.has(main.name)) this.ends(c, main);
    c.restore();
    if (time.cursor !== null) this.tell(c, box);
  }

  frame(c, box) {
    const across = (box.right - box.left) / 2 / this.scale;
    const up = (box.bottom - box.top) / 2 / this.scale;
    const [cx, cy] = this.centre;
    const gap = 74;
    const xs = roundTicks(cx - across, cx + across, box.right - box.left, gap);
    const ys = roundTicks(cy - up, cy + up, box.bottom - box.top, gap);
    c.font = `12px ${FONT}`;
    c.lineWidth = 1;
    c.strokeStyle = colours.grid;
    c.fillStyle = colours["ink-3"];
    c.beginPath();
    c.textAlign = "center";
    for (const tick of xs.ticks) {
      const x = Math.round(this.x(tick)) + 0.5;
      c.moveTo(x, box.top);
      c.lineTo(x, box.bottom);
      c.fillText(xs.text(tick), x, box.bottom + 16);
    }
    c.textAlign = "right";
    for (const tick of ys.ticks) {
      const y = Math.round(this.y(tick)) + 0.5;
      c.moveTo(box.left, y);
      c.lineTo(box.right, y);
      c.fillText(ys.text(tick), box.left - 6, y + 4);
    }
    c.stroke();
    c.strokeStyle = colours["ink-3"];
    c.strokeRect(box.left + 0.5, box.top + 0.5, box.right - box.left, box.bottom - box.top);
    c.fillStyle = colours["ink-2"];
    c.fillText("x [m]", box.right, box.bottom + 31);
    c.save();
    c.translate(12, (box.top + box.bottom) / 2);
    c.rotate(-Math.PI / 2);
    c.textAlign = "center";
    c.fillText("y [m]", 0, 0);
    c.restore();
  }

  dots(c, { x, y }, colour, radius) {
    c.fillStyle = colours[colour];
    c.beginPath();
    for (let i = 0; i < x.length; i += 1) {
      c.moveTo(this.x(x[i]) + radius, this.y(y[i]));
      c.arc(this.x(x[i]), this.y(y[i]), radius, 0, 7);
    }
    c.fill();
  }

  trail(c, { colour, dashed, faint, x, y, t }) {
    const [from, to] = [Math.max(0, lastUpTo(t, time.view[0])), Math.min(x.length - 1, lastUpTo(t, time.view[1]))];
    c.strokeStyle = colours[colour];
    c.lineJoin = c.lineCap = "round";
    c.lineWidth = faint ? 6 : 1.9;
    c.setLineDash(dashed ? [7, 4] : []);
    for (const [first, last, alpha] of [[0, from, 0.2], [from, to, 1], [to, x.length - 1, 0.2]]) {
      if (last <= first) continue;
      c.globalAlpha = alpha * (faint ? 0.4 : 1);
      c.beginPath();
      let before = null;
      for (let i = first; i <= last; i += 1) {
        if (Number.isNaN(y[i])) {
          before = null;
          continue;
        }
        const at = [this.x(x[i]), this.y(y[i])];
        if (before && i < last && Math.hypot(at[0] - before[0], at[1] - before[1]) < 0.7) continue;
        if (before) c.lineTo(...at);
        else c.moveTo(...at);
        before = at;
      }
      c.stroke();
    }
    c.globalAlpha = 1;
    c.lineCap = "butt";
    c.setLineDash([]);
  }

  ellipses(c, all) {
    c.strokeStyle = colours.ink;
    c.lineWidth = 1.1;
    for (const [x, y, a, b, angle] of all) {
      c.beginPath();
      c.ellipse(this.x(x), this.y(y), a * this.scale, b * this.scale, -angle, 0, 7);
      c.stroke();
    }
  }

  crosses(c, { x, y }) {
    c.strokeStyle = colours.hit;
    c.lineWidth = 1;
    c.globalAlpha = 0.65;
    c.beginPath();
    for (let i = 0; i < x.length; i += 1) {
      const [px, py] = [this.x(x[i]), this.y(y[i])];
      c.moveTo(px - 3, py);
      c.lineTo(px + 3, py);
      c.moveTo(px, py - 3);
      c.lineTo(px, py + 3);
    }
    c.stroke();
    c.globalAlpha = 1;
  }

  rings(c, { x, y }) {
    c.strokeStyle = colours.hit;
    c.lineWidth = 1.5;
    const radius = Math.min(9, Math.max(2.5, this.scale * 0.008));
    c.beginPath();
    for (let i = 0; i < x.length; i += 1) {
      c.moveTo(this.x(x[i]) + radius, this.y(y[i]));
      c.arc(this.x(x[i]), this.y(y[i]), radius, 0, 7);
    }
    c.stroke();
  }

  ends(c, { x, y }) {
    c.fillStyle = colours.panel;
    c.strokeStyle = colours.ink;
    c.lineWidth = 1.6;
    c.beginPath();
    c.arc(this.x(x[0]), this.y(y[0]), 4.5, 0, 7);
    c.fill();
    c.stroke();
    const last = x.length - 1;
    c.beginPath();
    c.rect(this.x(x[last]) - 4, this.y(y[last]) - 4, 8, 8);
    c.fill();
    c.stroke();
  }

  // Where each trail was at the moment under the pointer.
  tell(c, box) {
    const lines = [];
    let corner = box.left;
    for (const { name, colour, x, y, t } of this.figure.floor.trails) {
      const i = this.hidden.has(name) ? -1 : nearest(t, time.cursor);
      if (i < 0) continue;
      c.fillStyle = colours[colour];
      c.strokeStyle = colours.panel;
      c.lineWidth = 1.5;
      c.beginPath();
      c.arc(this.x(x[i]), this.y(y[i]), 5, 0, 7);
      c.fill();
      c.stroke();
      corner = this.x(x[i]);
      lines.push([colour, `${name}  ${fixed(x[i], 4)}, ${fixed(y[i], 4)} m`]);
    }
    tellBox(c, lines, corner, box.top + 6, box.left + 4, box.right - 4);
  }
}
