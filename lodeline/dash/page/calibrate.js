// A calibration under way beside the robot: what to do, what has been seen, before and after.

import { $, FONT, Surface, colours, el, put } from "./dom.js";

const NAMES = { gyro: "Gyro", accel: "Accelerometer", mag: "Compass", wheels: "Wheels" };
const ENDS = { running: " calibration", refused: " \u2013 refused", written: " calibrated" };
const SILENCE_MS = 4000;

export class Calibration {
  constructor() {
    this.box = $("calibrate");
    this.surface = new Surface($("calibrate-ring"), () => this.draw());
    $("calibrate-close").addEventListener("click", () => { this.box.hidden = true; });
  }

  show(said) {
    this.said = said;
    this.box.hidden = false;
    this.box.dataset.state = said.state;
    put($("calibrate-title"), `${NAMES[said.kind] ?? said.kind}${ENDS[said.state] ?? ""}`);
    put($("calibrate-todo"), said.state === "running" ? said.todo : "");
    put($("calibrate-text"), said.text);
    put($("calibrate-words"), said.words ?? said.hint ?? "");
    const sides = said.state === "running" ? said.names ?? [] : [];
    $("calibrate-sides").replaceChildren(...sides.map((name, i) => {
      const done = said.parts[i] >= 1;
      return el("li", { "data-done": done }, `${done ? "\u2713" : "\u25cb"} ${name}`);
    }));
    const drawn = said.circles || (said.state === "running" && !sides.length);
    $("calibrate-ring").hidden = !drawn;
    this.draw();
    // Who is ended in the middle of it says no more.
    clearTimeout(this.silence);
    if (said.state === "running") this.silence = setTimeout(() => { this.box.hidden = true; }, SILENCE_MS);
  }

  draw() {
    const c = this.surface.begin();
    if (!c || !this.said) return;
    if (this.said.circles) this.circles(c, this.said.circles);
    else this.ring(c, this.said.parts ?? []);
  }

  // One arc for each part, counter-clockwise from the right, fuller the more often it was seen.
  ring(c, parts) {
    const { width, height } = this.surface;
    const radius = Math.min(width, height) / 2 - 12;
    const step = (2 * Math.PI) / parts.length;
    const gap = parts.length > 1 ? 0.04 : 0;
    c.translate(width / 2, height / 2);
    c.lineWidth = 14;
    parts.forEach((part, i) => {
      for (const [colour, share] of [[colours.line, 1], [colours.truth, part]]) {
        if (share <= 0) continue;
        c.strokeStyle = colour;
        c.globalAlpha = parts.length > 1 && share > 0 && share < 1 ? 0.5 : 1;
        const end = parts.length > 1 ? i + 1 : share;
        c.beginPath();
        c.arc(0, 0, radius, -(i * step + gap), -(end * step - gap), true);
        c.stroke();
      }
    });
    c.globalAlpha = 1;
  }

  // The field as it was seen before and as it is seen now, about the centre that it should have.
  circles(c, { before, after, radius }) {
    const { width, height } = this.surface;
    const reach = Math.max(...[...before, ...after].flat().map(Math.abs)) * 1.1;
    const size = Math.min(width / 2, height - 18) / 2 - 4;
    for (const [name, points, x, colour] of [["before", before, width / 4, "odom"], ["after", after, (3 * width) / 4, "truth"]]) {
      const y = 18 + size;
      c.strokeStyle = colours.line;
      c.lineWidth = 1;
      c.beginPath();
      c.moveTo(x - size, y);
      c.lineTo(x + size, y);
      c.moveTo(x, y - size);
      c.lineTo(x, y + size);
      c.stroke();
      c.strokeStyle = colours["ink-3"];
      c.setLineDash([3, 3]);
      c.beginPath();
      c.arc(x, y, (radius / reach) * size, 0, 7);
      c.stroke();
      c.setLineDash([]);
      c.fillStyle = colours[colour];
      for (const [px, py] of points) c.fillRect(x + (px / reach) * size - 1.5, y - (py / reach) * size - 1.5, 3, 3);
      c.font = `12px ${FONT}`;
      c.textAlign = "center";
      c.fillStyle = colours["ink-2"];
      c.fillText(name, x, 12);
    }
  }
}
