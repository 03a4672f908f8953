// The log: lines of the supervisors, and what this page itself has to tell. Newest at the bottom.

import { clock, el } from "./dom.js";

const KEPT = 500;

export class Log {
  constructor(place) {
    this.place = place;
    this.list = el("ol");
    this.lines = [];
    place.append(this.list);
  }

  add(at, who, text) {
    const { place, list } = this;
    this.lines.push({ at, who, text });
    if (this.lines.length > KEPT) this.lines.shift();
    const atEnd = place.scrollHeight - place.scrollTop - place.clientHeight < 30;
    list.append(el("li", {}, el("time", {}, clock(at)), el("b", {}, who), el("span", {}, text)));
    while (list.childElementCount > KEPT) list.firstChild.remove();
    if (atEnd) this.toEnd();
  }

  // A line that a gateway tells again, for the page was away from it, is no new one.
  addOnce(at, who, text) {
    const known = this.lines.some((line) => line.at === at && line.who === who && line.text === text);
    if (!known) this.add(at, who, text);
  }

  // The newest lines of one node.
  of(name, count) {
    return this.lines.filter(({ who }) => who === name).slice(-count);
  }

  toEnd() {
    this.place.scrollTop = this.place.scrollHeight;
  }
}
