// Artificial horizon and compass.

import { FONT, Surface, colours, degrees } from "./dom.js";

const DEGREES_UP = 20; // pitch from the middle to the rim

export class Horizon {
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  draw(tilt) {
    const c = this.surface.begin();
    if (!c) return;
    const { width, height } = this.surface;
    const r = Math.min(width, height) / 2 - 3;
    c.translate(width / 2, height / 2);
    c.beginPath();
    c.arc(0, 0, r, 0, 7);
    c.save();
    c.clip();
    c.fillStyle = colours.raised;
    c.fillRect(-r, -r, 2 * r, 2 * r);
    if (tilt) this.world(c, r, tilt);
    c.restore();
    c.strokeStyle = colours["ink-3"];
    c.lineWidth = 1.5;
    c.stroke();
    this.wings(c, r);
  }

  // FLU: rolling to the right turns the world to the left; nose down (pitch > 0) lifts it.
  world(c, r, { roll, pitch }) {
    c.rotate(-roll);
    c.translate(0, (-degrees(pitch) / DEGREES_UP) * r);
    c.fillStyle = colours.sky;
    c.fillRect(-3 * r, -6 * r, 6 * r, 6 * r);
    c.fillStyle = colours.earth;
    c.fillRect(-3 * r, 0, 6 * r, 6 * r);
    c.strokeStyle = colours.ink;
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(-3 * r, 0);
    c.lineTo(3 * r, 0);
    c.stroke();
    c.globalAlpha = 0.55;
    c.lineWidth = 1;
    c.beginPath();
    for (const angle of [-15, -10, -5, 5, 10, 15]) {
      const y = (-angle / DEGREES_UP) * r;
      const half = angle % 10 ? r * 0.13 : r * 0.26;
      c.moveTo(-half, y);
      c.lineTo(half, y);
    }
    c.stroke();
    c.globalAlpha = 1;
  }

  wings(c, r) {
    c.strokeStyle = colours.odom;
    c.lineWidth = 3;
    c.lineCap = "round";
    c.beginPath();
    c.moveTo(-r * 0.62, 0);
    c.lineTo(-r * 0.25, 0);
    c.lineTo(0, r * 0.14);
    c.lineTo(r * 0.25, 0);
    c.lineTo(r * 0.62, 0);
    c.stroke();
    c.lineCap = "butt";
  }
}

export class Compass {
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  // `yaw` is counter-clockwise from east; north is up, as on the map.
  draw(yaw, std) {
    const c = this.surface.begin();
    if (!c) return;
    const { width, height } = this.surface;
    const r = Math.min(width, height) / 2 - 3;
    c.translate(width / 2, height / 2);
    c.strokeStyle = colours["ink-3"];
    c.lineWidth = 1.5;
    c.beginPath();
    c.arc(0, 0, r, 0, 7);
    c.fillStyle = colours.raised;
    c.fill();
    c.stroke();
    c.beginPath();
    for (let i = 0; i < 24; i += 1) {
      const inner = r * (i % 6 ? 0.93 : 0.87);
      const [dx, dy] = [Math.cos((i * Math.PI) / 12), Math.sin((i * Math.PI) / 12)];
      c.moveTo(inner * dx, inner * dy);
      c.lineTo(r * dx, r * dy);
    }
    c.stroke();
    c.font = `600 ${Math.max(11, r * 0.2)}px ${FONT}`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    for (const [name, x, y] of [["N", 0, -1], ["E", 1, 0], ["S", 0, 1], ["W", -1, 0]]) {
      c.fillStyle = name === "N" ? colours.hit : colours["ink-2"];
      c.fillText(name, x * r * 0.71, y * r * 0.71);
    }
    c.textBaseline = "alphabetic";
    if (yaw !== undefined) this.needle(c, r, yaw, std);
  }

  needle(c, r, yaw, std) {
    c.rotate(-yaw);
    if (std) {
      c.beginPath();
      c.moveTo(0, 0);
      c.arc(0, 0, r * 0.9, -Math.min(3, 1.96 * std), Math.min(3, 1.96 * std));
      c.closePath();
      c.fillStyle = colours.ekf;
      c.globalAlpha = 0.2;
      c.fill();
      c.globalAlpha = 1;
    }
    c.beginPath();
    c.moveTo(r * 0.86, 0);
    c.lineTo(-r * 0.3, r * 0.15);
    c.lineTo(-r * 0.18, 0);
    c.lineTo(-r * 0.3, -r * 0.15);
    c.closePath();
    c.fillStyle = colours.ekf;
    c.fill();
  }
}
