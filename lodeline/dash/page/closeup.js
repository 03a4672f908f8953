// The estimate under a magnifying glass: its ellipse, and the truth and the odometry beside it.

import { FONT, Surface, colours } from "./dom.js";

const CLEAR = 9; // px between it and the robot under it

export class CloseUp {
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  // To the other end of its side of the map, when the robot at (x, y) px would be under it.
  avoid(robot) {
    const { canvas } = this.surface;
    const { offsetLeft: left, offsetTop: top, offsetWidth: wide, offsetHeight: high } = canvas;
    const within = (at, low, length) => at > low - CLEAR && at < low + length + CLEAR;
    if (robot && within(robot[0], left, wide) && within(robot[1], top, high)) canvas.classList.toggle("up");
  }

  draw(frame) {
    const c = this.surface.begin();
    if (!c || !frame?.ellipse) return;
    const size = this.surface.width;
    const middle = size / 2;
    const reach = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 5, 25, 100].find((m) => m > frame.ellipse.a * 1.15) ?? 100;
    const scale = (middle - 4) / reach;
    c.save();
    c.beginPath();
    c.arc(middle, middle, middle - 2, 0, 7);
    c.fillStyle = colours.panel;
    c.globalAlpha = 0.94;
    c.fill();
    c.globalAlpha = 1;
    c.lineWidth = 1.5;
    c.strokeStyle = colours["ink-3"];
    c.stroke();
    c.clip();
    c.strokeStyle = colours.line;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(0, middle);
    c.lineTo(size, middle);
    c.moveTo(middle, 0);
    c.lineTo(middle, size);
    c.moveTo(middle * 1.5 - 2, middle);
    c.arc(middle, middle, (middle - 4) / 2, 0, 7);
    c.stroke();
    this.ellipse(c, middle, scale, frame.ellipse);
    const at = (other) => [middle + (other.x - frame.pose.x) * scale, middle - (other.y - frame.pose.y) * scale];
    if (frame.truth) this.dot(c, at(frame.truth), colours.truth, true);
    if (frame.odom) this.dot(c, at(frame.odom), colours.odom, false);
    c.restore();
    c.font = `11px ${FONT}`;
    c.textAlign = "center";
    c.fillStyle = colours["ink-2"];
    const text = reach < 1 ? `radius ${reach * 1000} mm` : `radius ${reach} m`;
    c.lineWidth = 3;
    c.strokeStyle = colours.panel;
    c.strokeText(text, middle, size - 12);
    c.fillText(text, middle, size - 12);
  }

  ellipse(c, middle, scale, { a, b, angle }) {
    c.beginPath();
    c.ellipse(middle, middle, Math.max(1, a * scale), Math.max(1, b * scale), -angle, 0, 7);
    c.fillStyle = colours.ekf;
    c.globalAlpha = 0.22;
    c.fill();
    c.globalAlpha = 1;
    c.strokeStyle = colours.ekf;
    c.lineWidth = 2;
    c.stroke();
    c.beginPath();
    c.arc(middle, middle, 2.5, 0, 7);
    c.fillStyle = colours.ekf;
    c.fill();
  }

  // The truth is a diamond, odometry a square: not by colour alone.
  dot(c, [x, y], colour, diamond) {
    c.save();
    c.translate(x, y);
    if (diamond) c.rotate(Math.PI / 4);
    c.fillStyle = colour;
    c.fillRect(-4, -4, 8, 8);
    c.restore();
  }
}
