// The pipeline as a graph, left to right: nodes in layers, on each edge what flows over it.

import { hz, ms, percent, put, svg, wide } from "./dom.js";
import { healthOf, nodesOf } from "./health.js";

const NODE = { width: 132, height: 38 };
const ROW = 46;
const WIDTH = 1230;
const LEFT = 110; // room for keys that come from outside
const RIGHT = 140; // room for keys that nobody here reads
const TOP = 10;
const LEGEND = "key, rate, age on arrival: median / 99 %, \u2715 samples lost or too late";
const ONE_LINE = 235; // px between two layers in which a label needs but one line
const TWINS = { one: 24, two: 31 }; // px between two wires of a pair, by the lines of their labels
const UP = 2.5; // px

export class Graph {
  constructor(place, onPick) {
    this.place = place;
    this.onPick = onPick;
    this.shape = "";
  }

  draw(store) {
    if (!store.scene) return;
    const status = store.shownStatus;
    const names = nodesOf(store.scene, status);
    const { edges } = store.scene;
    const shape = JSON.stringify([names, edges, store.scene.keys]);
    if (shape !== this.shape) {
      this.shape = shape;
      this.build(store.scene, names, edges);
    }
    for (const [name, node] of this.nodes) this.updateNode(node, healthOf(name, store.scene, status));
    for (const edge of this.edges) this.updateEdge(edge, status);
  }

  build(scene, names, edges) {
    const layers = layered(names, edges.filter((edge) => edge.from));
    const depth = Math.max(1, layers.length - 1);
    const rows = Math.max(3, ...layers.map((layer) => 1 + Math.max(...layer.map((item) => item.row))));
    const height = TOP + Math.ceil(rows) * ROW;
    this.root = svg("svg", { viewBox: `0 0 ${WIDTH} ${height}`, role: "group", "aria-label": "Pipeline graph" });
    const wires = svg("g");
    const labels = svg("g");
    const step = (WIDTH - LEFT - RIGHT - NODE.width) / depth;
    const places = new Map();
    layers.forEach((layer, column) => {
      for (const { name, row } of layer) {
        places.set(name, { x: LEFT + (layers.length > 1 ? column * step : 0), y: TOP + row * ROW + (ROW - NODE.height) / 2 });
      }
    });
    this.edges = [];
    this.gap = step - NODE.width;
    this.wire(edges, places, wires, labels);
    this.dangling(scene, edges, places, wires, labels);
    this.root.append(wires, labels, svg("text", { class: "legend", x: WIDTH - 6, y: height - 6 }, LEGEND));
    this.nodes = new Map(names.map((name) => [name, this.box(name, places.get(name))]));
    this.place.replaceChildren(this.root);
  }

  wire(edges, places, wires, labels) {
    for (const edge of edges) {
      const to = places.get(edge.to);
      const from = edge.from && places.get(edge.from);
      const twins = edges.filter((other) => other.to === edge.to && (from ? other.from === edge.from : !other.from));
      const place = twins.indexOf(edge);
      const one = this.gap >= ONE_LINE;
      const pair = (place - (twins.length - 1) / 2) * (one ? TWINS.one : TWINS.two);
      const aside = one || twins.length === 1 ? pair : pair - UP; // away from the row below
      const end = [to.x, to.y + NODE.height / 2 + aside];
      if (from) {
        const start = [from.x + NODE.width, from.y + NODE.height / 2 + aside];
        this.add(edge, curve(start, end), [start[0] + 10, start[1]], wires, labels);
      } else {
        const start = [to.x - LEFT + 6, end[1]];
        this.add(edge, `M${start}L${end}`, [start[0], end[1]], wires, labels);
      }
      wires.append(svg("path", { class: "head", d: `M${end}l-8-4v8z` }));
    }
  }

  // What a node sends and nobody here reads: the results.
  dangling(scene, edges, places, wires, labels) {
    const read = new Set(edges.map((edge) => edge.key));
    for (const [name, place] of places) {
      const keys = Object.keys(scene.keys).filter((key) => scene.keys[key].node === name && !read.has(key));
      keys.forEach((key, i) => {
        const y = place.y + NODE.height / 2 + (i - (keys.length - 1) / 2) * 28;
        const start = [place.x + NODE.width, y];
        const end = [start[0] + 112, y];
        this.add({ key, from: name, to: null }, `M${start}L${end}`, [start[0] + 8, y], wires, labels);
        wires.append(svg("path", { class: "head", d: `M${end}l-8-4v8z` }));
      });
    }
  }

  add(edge, path, [x, y], wires, labels) {
    const wire = svg("path", { class: "wire", d: path });
    const key = svg("tspan", { class: "key" }, edge.key);
    const rate = svg("tspan", { class: "figures", dx: 6 });
    const age = svg("tspan", { class: "figures" });
    const loss = svg("tspan", { class: "loss", dx: 5 });
    const above = svg("text", { x, y: y - 5 }, key, rate);
    wires.append(wire);
    labels.append(above);
    if (this.gap >= ONE_LINE) {
      age.setAttribute("dx", 8);
      above.append(age, loss);
    } else labels.append(svg("text", { x, y: y + 13 }, age, loss));
    this.edges.push({ ...edge, wire, rate, age, loss });
  }

  updateEdge(edge, status) {
    const rate = edge.from ? status?.nodes[edge.from]?.rates[edge.key] : undefined;
    put(edge.rate, edge.from ? `${wide(hz(rate), 3)} Hz` : "");
    edge.wire.classList.toggle("still", !rate);
    const said = edge.to && status?.nodes[edge.to];
    if (!said) return;
    if (!(edge.key in said.received)) {
      put(edge.age, edge.from ? "direct call" : "");
      return;
    }
    const p50 = said.age_p50[edge.key];
    put(edge.age, p50 === undefined ? "" : `${ms(p50)} / ${ms(said.age_p99[edge.key])} ms`);
    const drops = (said.lost[edge.key] ?? 0) + (said.late[edge.key] ?? 0);
    put(edge.loss, drops ? `\u2715 ${drops}` : "");
  }

  box(name, { x, y }) {
    const { width, height } = NODE;
    const word = svg("text", { class: "word", x: x + 13, y: y + 32 });
    const group = svg(
      "g",
      { class: "node", tabindex: 0, role: "button", "data-node": name },
      svg("rect", { class: "box", x, y, width, height, rx: 6 }),
      svg("rect", { class: "bar", x, y: y + 5, width: 4, height: height - 10, rx: 2 }),
      svg("text", { class: "title", x: x + 13, y: y + 17 }, name),
      word,
    );
    group.addEventListener("click", () => this.onPick(name));
    group.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      this.onPick(name);
    });
    this.root.append(group);
    return { name, group, word };
  }

  updateNode({ name, group, word }, health) {
    group.dataset.level = health.level;
    const cost = health.level === "good" && health.said ? ` \u00b7 ${percent(health.said.cpu)}` : "";
    put(word, `${health.mark} ${health.word}${cost}`);
    group.setAttribute("aria-label", `${name}: ${health.word}. Show details`);
  }
}

// Flat for most of the way, where the label stands on it, then over to its reader.
const curve = (a, b) => {
  const flat = a[0] + (b[0] - a[0]) * 0.72;
  const bend = (b[0] - flat) * 0.5;
  return `M${a}L${flat},${a[1]}C${flat + bend},${a[1]} ${b[0] - bend},${b[1]} ${b}`;
};

// Layers of {name, row}: as far right as the longest way to a node, beside what it hears.
export function layered(names, edges) {
  const depth = new Map(names.map((name) => [name, 0]));
  for (let pass = 0; pass < names.length; pass += 1) {
    for (const { from, to } of edges) {
      if (depth.has(from) && depth.has(to)) depth.set(to, Math.min(names.length, Math.max(depth.get(to), depth.get(from) + 1)));
    }
  }
  const connected = new Set(edges.flatMap((edge) => [edge.from, edge.to]));
  const layers = [];
  const rows = new Map();
  for (const level of [...new Set(depth.values())].sort((a, b) => a - b)) {
    const layer = names.filter((name) => depth.get(name) === level);
    const wanted = (name) => {
      const heard = edges.filter((edge) => edge.to === name && rows.has(edge.from)).map((edge) => rows.get(edge.from));
      if (heard.length) return heard.reduce((a, b) => a + b) / heard.length;
      return connected.has(name) ? layer.indexOf(name) : names.length;
    };
    const sorted = layer.map((name) => [name, wanted(name)]).sort((a, b) => a[1] - b[1]);
    let free = 0;
    layers.push(sorted.map(([name, row]) => {
      const own = level === 0 ? free : Math.max(free, row);
      rows.set(name, own);
      free = own + 1;
      return { name, row: own };
    }));
  }
  return layers;
}
