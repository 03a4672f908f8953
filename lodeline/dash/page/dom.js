// Small helpers: elements, numbers as text, canvases that are sharp on every screen.

export const $ = (id) => document.getElementById(id);

export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

export function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

export function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

const MINUS = "\u2212";
export const NONE = "\u2013";

export function fixed(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const text = Math.abs(value).toFixed(digits);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

export const degrees = (radians) => (radians * 180) / Math.PI;
export const wrapped = (radians) => Math.atan2(Math.sin(radians), Math.cos(radians));
export const ms = (seconds) => {
  if (seconds === undefined || seconds === null) return NONE;
  const value = seconds * 1e3;
  return fixed(value, Math.abs(value) < 9.95 ? 1 : 0);
};
export const hz = (rate) => (rate === undefined ? NONE : fixed(rate, rate < 9.95 ? 1 : 0));
export const percent = (part) => `${fixed(part * 100, part < 0.0995 ? 1 : 0)} %`;

// Padded with spaces as wide as a digit, so that what follows keeps its place.
export const wide = (text, length) => text.padStart(length, "\u2007");

export function duration(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const rest = `${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
  return hours ? `${hours}:${rest}` : rest;
}

export function clock(seconds) {
  return new Date(seconds * 1e3).toTimeString().slice(0, 8);
}

// Colours of the theme, by the names they have in page.css.
const names = ["bg", "panel", "raised", "ink", "ink-2", "ink-3", "line", "grid", "ekf", "odom", "truth", "magnet", "hit", "good", "warn", "bad", "sky", "earth"];
export const colours = {};

export function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of names) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

export const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';

// A canvas measured in units of a sixteenth of the root's font size, so that it grows with the
// text; `begin()` clears it and gives its context, null if unseen.
export class Surface {
  constructor(canvas, onResize = () => {}) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.unit = 1;
    this.width = 0;
    this.height = 0;
    new ResizeObserver((entries) => {
      const box = entries[0].contentRect;
      this.unit = parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
      this.width = box.width / this.unit;
      this.height = box.height / this.unit;
      onResize();
    }).observe(canvas);
  }

  // Where an event is, in the canvas's own units.
  at(event) {
    return [event.offsetX / this.unit, event.offsetY / this.unit];
  }

  begin() {
    const { canvas, context, width, height } = this;
    if (width < 2 || height < 2) return null;
    const ratio = this.unit * Math.min(window.devicePixelRatio || 1, 2);
    const wide = Math.round(width * ratio);
    const high = Math.round(height * ratio);
    if (canvas.width !== wide || canvas.height !== high) {
      canvas.width = wide;
      canvas.height = high;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    return context;
  }
}
