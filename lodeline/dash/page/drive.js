// Driving with arrow keys or the stick. A dead man's handle: who lets go, stops.

import { $, put } from "./dom.js";

const PERIOD_MS = 100;
const STOPS = ["Escape", " "];
const KEYS = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };

export class Drive {
  constructor(send) {
    this.send = send;
    this.allowed = false;
    this.on = false;
    this.held = new Set();
    this.stick = [0, 0];
    const toggle = $("drive-toggle");
    toggle.addEventListener("click", () => this.turn(!this.on));
    document.addEventListener("keydown", (event) => this.key(event, true));
    document.addEventListener("keyup", (event) => this.key(event, false));
    window.addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.turn(false));
    this.listenToStick($("stick"));
  }

  allow(allowed) {
    this.allowed = allowed;
    $("drive").hidden = !allowed;
    if (!allowed) this.turn(false);
  }

  turn(on) {
    if (on === this.on || (on && !this.allowed)) return;
    this.on = on;
    $("drive").classList.toggle("on", on);
    const toggle = $("drive-toggle");
    toggle.setAttribute("aria-pressed", String(on));
    put(toggle, on ? "Hand back" : "Drive");
    this.letGo();
    clearInterval(this.timer);
    if (on) this.timer = setInterval(() => this.tell(), PERIOD_MS);
    else this.send({ do: "drive", forward: 0, left: 0, done: true });
  }

  tell() {
    let [forward, left] = this.stick;
    for (const key of this.held) {
      forward += KEYS[key][0];
      left += KEYS[key][1];
    }
    this.send({ do: "drive", forward, left });
  }

  letGo() {
    this.held.clear();
    this.moveStick(0, 0);
    if (this.on) this.tell();
  }

  key(event, down) {
    // Whatever has the focus by then, a key that is let go stops what it did.
    if (!down && this.held.delete(event.key)) this.tell();
    if (!down || !this.allowed) return;
    if (this.on && STOPS.includes(event.key)) this.stop(event);
    if (event.ctrlKey || event.altKey || event.metaKey) this.letGo();
    else if (event.key in KEYS && this.takes(event.target)) {
      event.preventDefault();
      if (event.repeat) return;
      this.turn(true);
      this.held.add(event.key);
      this.tell();
    }
  }

  // Arrow keys scroll, and choose tabs: they begin to drive on the map alone.
  takes(target) {
    if ($("detail").open || target.closest?.("input, [role=tab], dialog")) return false;
    return this.on || Boolean(target.closest?.("#map"));
  }

  stop(event) {
    event.preventDefault();
    event.stopImmediatePropagation(); // a space stops the robot, and not the picture as well
    this.turn(false);
  }

  listenToStick(stick) {
    const follow = (event) => {
      const box = stick.getBoundingClientRect();
      const reach = box.width / 3;
      const x = (event.clientX - box.left - box.width / 2) / reach;
      const y = (event.clientY - box.top - box.height / 2) / reach;
      const length = Math.max(1, Math.hypot(x, y));
      this.moveStick(-y / length, -x / length);
    };
    stick.addEventListener("pointerdown", (event) => {
      stick.setPointerCapture(event.pointerId);
      follow(event);
    });
    stick.addEventListener("pointermove", (event) => stick.hasPointerCapture(event.pointerId) && follow(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      stick.addEventListener(name, () => this.letGo());
    }
  }

  moveStick(forward, left) {
    this.stick = [forward, left];
    $("stick").firstElementChild.style.transform = `translate(${-left * 85}%, ${-forward * 85}%)`;
  }
}
