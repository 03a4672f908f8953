// The list of nodes, and one node in detail with its restart button.

import { $, NONE, clock, duration, el, fixed, hz, ms, percent, put } from "./dom.js";
import { healthOf, nodesOf } from "./health.js";

const MB = 1 << 20;
const LINES = 6;
const HEADINGS = [["Node"], ["State"], ["Host"], ["Out", "n"], ["Age p50 / p99", "n"], ["Lost", "n"], ["Late", "n"], ["Refused", "n"], ["CPU", "n"], ["Memory", "n"], ["Restarts", "n"], ["Last error"]];
const sum = (counts) => Object.values(counts ?? {}).reduce((a, b) => a + b, 0);
const worst = (ages) => {
  const all = Object.values(ages ?? {});
  return all.length ? Math.max(...all) : undefined;
};

export class NodeTable {
  constructor(place, onPick) {
    this.place = place;
    this.onPick = onPick;
    this.rows = new Map();
  }

  draw(store) {
    if (!store.scene) return;
    const status = store.shownStatus;
    const names = nodesOf(store.scene, status);
    if (names.join() !== [...this.rows.keys()].join()) this.build(names);
    for (const name of names) this.update(this.rows.get(name), healthOf(name, store.scene, status));
  }

  build(names) {
    const head = el("tr", {}, ...HEADINGS.map(([text, kind = ""]) => el("th", { class: kind, scope: "col" }, text)));
    const body = el("tbody");
    this.rows = new Map(names.map((name) => {
      const pick = el("button", { type: "button", "data-node": name }, name);
      pick.addEventListener("click", () => this.onPick(name));
      const cells = HEADINGS.slice(1).map(([, kind = ""], i) => el("td", { class: kind || (i === 0 ? "state" : i === 10 ? "error" : "") }));
      const row = el("tr", {}, el("td", {}, pick), ...cells);
      body.append(row);
      return [name, { row, cells }];
    }));
    this.place.replaceChildren(el("table", {}, el("thead", {}, head), body));
  }

  update({ row, cells }, { level, mark, word, said, process }) {
    row.dataset.level = level;
    const rates = Object.values(said?.rates ?? {});
    const texts = [
      `${mark} ${word}`,
      said?.host ?? process?.host ?? "",
      rates.length ? `${rates.map(hz).join(", ")} Hz` : "",
      said && worst(said.age_p50) !== undefined ? `${ms(worst(said.age_p50))} / ${ms(worst(said.age_p99))} ms` : "",
      said ? String(sum(said.lost) + (said.ticks["missed tick"] ?? 0)) : "",
      said ? String(sum(said.late) + (said.ticks["late tick"] ?? 0)) : "",
      said ? String(sum(said.rejected)) : "",
      said ? percent(said.cpu) : "",
      said ? `${fixed(said.rss / MB, 0)} MB` : "",
      String(process?.restarts ?? said?.restarts ?? ""),
      said?.last_error || (process?.last_exit ? `last exit: ${process.last_exit}` : ""),
    ];
    texts.forEach((text, i) => put(cells[i], text));
  }
}

export class Detail {
  constructor(log, onRestart) {
    this.log = log;
    this.dialog = $("detail");
    this.button = $("restart");
    this.trusted = false;
    this.button.addEventListener("click", () => {
      // A node that is stopped by mistake stops a robot: ask once.
      if (this.button.dataset.sure) {
        onRestart(this.name);
        this.calm();
      } else {
        this.button.dataset.sure = "yes";
        put(this.button, `Really restart ${this.name}?`);
        this.asking = setTimeout(() => this.calm(), 4000);
      }
    });
  }

  calm() {
    clearTimeout(this.asking);
    delete this.button.dataset.sure;
    put(this.button, "Restart");
  }

  open(name, store) {
    this.name = name;
    this.calm();
    this.draw(store);
    if (!this.dialog.open) this.dialog.showModal();
  }

  draw(store) {
    if (!store.scene || this.name === undefined) return;
    const marked = getSelection();
    if (!marked.isCollapsed && this.dialog.contains(marked.anchorNode)) return; // to be copied
    const health = healthOf(this.name, store.scene, store.shownStatus);
    put($("detail-name"), this.name);
    this.button.hidden = !this.trusted;
    $("detail-body").replaceChildren(...this.body(store, health));
  }

  body(store, { level, mark, word, said, process }) {
    const fact = (name, text) => (text === undefined || text === "" ? [] : [el("dt", {}, name), el("dd", {}, String(text))]);
    const facts = el("dl", { class: "facts", "data-level": level },
      el("dt", {}, "State"), el("dd", { class: "state" }, `${mark} ${word}`),
      ...fact("Host", said?.host ?? process?.host),
      ...fact("Process", process && `${process.process}, pid ${process.pid ?? NONE}`),
      ...fact("Up", process?.uptime ? duration(process.uptime) : ""),
      ...fact("Restarts", process?.restarts ?? said?.restarts),
      ...fact("Last exit", process?.last_exit),
      ...fact("CPU, memory", said && `${percent(said.cpu)}, ${fixed(said.rss / MB, 0)} MB`),
      ...fact("Ticks late by", said?.jitter ? `${fixed(1000 * said.jitter, 2)} ms (99 %)` : ""),
      ...fact("Scheduling", [process?.scheduling, process?.refused].filter(Boolean).join("; ")),
      ...fact("Last error", said?.last_error));
    const parts = [facts];
    if (!said) return [...parts, ...this.words()];
    parts.push(...this.inputs(store, said), ...this.outputs(said));
    for (const [title, counts] of [["Refused", said.rejected], ["Ticks", said.ticks]]) {
      const some = Object.entries(counts).filter(([, count]) => count > 0);
      if (some.length) parts.push(el("h3", {}, `${title} since it started`), lines(["Cause", "Count"], some));
    }
    return [...parts, ...this.words()];
  }

  inputs(store, said) {
    const edges = store.scene.edges.filter((edge) => edge.to === this.name);
    const rows = edges.map(({ key, queue, max_age: oldest }) => [
      key,
      key in said.received ? `${ms(said.age_p50[key])} / ${ms(said.age_p99[key])} ms` : "direct call",
      said.lost[key] ?? NONE,
      said.late[key] ?? NONE,
      `${queue}, ${oldest === null ? "any age" : `${ms(oldest)} ms`}`,
    ]);
    return rows.length ? [el("h3", {}, "In"), lines(["Key", "Age p50 / p99", "Lost", "Late", "Queue, max"], rows)] : [];
  }

  // What it has said lately.
  words() {
    const said = this.log.of(this.name, LINES);
    const rows = said.map(({ at, text }) => el("li", {}, el("time", {}, clock(at)), el("span", {}, text)));
    return [el("h3", {}, "Log"), rows.length ? el("ol", { class: "log" }, ...rows) : el("p", { class: "quiet" }, "It has said nothing.")];
  }

  outputs(said) {
    const rows = Object.entries(said.rates).map(([key, rate]) => [key, `${fixed(rate, 1)} Hz`]);
    return rows.length ? [el("h3", {}, "Out"), lines(["Key", "Rate"], rows)] : [];
  }
}

function lines(headings, rows) {
  const cell = (tag) => (text, i) => el(tag, i ? { class: "n" } : {}, String(text));
  return el("table", {},
    el("thead", {}, el("tr", {}, ...headings.map(cell("th")))),
    el("tbody", {}, ...rows.map((row) => el("tr", {}, ...row.map(cell("td"))))));
}
