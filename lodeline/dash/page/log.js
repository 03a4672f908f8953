// What happened, newest at the bottom: lines of the supervisors, and changes seen on this page.

import { clock, el } from "./dom.js";
import { healthOf, nodesOf } from "./health.js";

const KEPT = 400;

export class Log {
  constructor(place) {
    this.place = place;
    this.list = el("ol");
    place.append(this.list);
    this.begin();
  }

  begin() {
    this.words = new Map();
    this.errors = new Map();
  }

  add(at, who, text) {
    const { place, list } = this;
    const atEnd = place.scrollHeight - place.scrollTop - place.clientHeight < 30;
    list.append(el("li", {}, el("time", {}, clock(at)), el("b", {}, who), el("span", {}, text)));
    while (list.childElementCount > KEPT) list.firstChild.remove();
    if (atEnd) place.scrollTop = place.scrollHeight;
  }

  // Tell what became different since the last status.
  watch(scene, status) {
    for (const name of nodesOf(scene, status)) {
      const { word, said, process } = healthOf(name, scene, status);
      const state = word.replace(/ \d+ s$/, "");
      const before = this.words.get(name);
      if (before !== undefined && before !== state) {
        const why = process?.last_exit && state !== "running" ? ` (last exit: ${process.last_exit})` : "";
        this.add(status.at, name, `${before} \u2192 ${state}${why}`);
      }
      this.words.set(name, state);
      const error = said?.last_error ?? "";
      if (error && this.errors.get(name) !== error) this.add(status.at, name, error);
      this.errors.set(name, error);
    }
  }
}
