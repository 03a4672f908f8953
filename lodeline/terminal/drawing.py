"""Pictures of a pipeline: plain text, Mermaid, Graphviz' DOT, and SVG that needs no program."""

from __future__ import annotations

from html import escape

from lodeline.pipeline.model import NodeSpec, Pipeline
from lodeline.terminal.wires import OUTSIDE, Wire, layers_of, wires_of


def as_text(pipeline: Pipeline) -> str:
    """Each node in the order of data flow, with what it sends, how often, and to whom."""
    wires = wires_of(pipeline)
    lines = [f"{pipeline.name}: {len(pipeline.nodes)} nodes on {', '.join(pipeline.hosts)}"]
    keys = {wire.key: wire for wire in wires}
    wide = max((len(key) for key in keys), default=0)
    kind = max((len(wire.type) for wire in wires), default=0)
    titles = {spec.name: _title(pipeline, spec) for spec in pipeline.nodes}
    for name, title in ({OUTSIDE: OUTSIDE} | titles).items():
        sent = [wire for wire in keys.values() if wire.source == name]
        if name == OUTSIDE and not sent:
            continue
        lines += ["", title]
        for wire in sent:
            rate = "" if wire.rate is None else f"{wire.rate:g} Hz"
            readers = [other for other in wires if other.key == wire.key and other.target]
            to = ", ".join(f"{other.target}{_policy(other)}" for other in readers) or "-"
            lines.append(f"  {wire.key:{wide}}  {wire.type:{kind}}  {rate:>7}  > {to}")
    return "\n".join(lines)


def _title(pipeline: Pipeline, spec: NodeSpec) -> str:
    notes = [f"on {spec.host}"] if len(pipeline.hosts) > 1 else []
    notes += [f"in process {spec.process}"] if spec.process != spec.name else []
    return f"{spec.name} ({', '.join(notes)})" if notes else spec.name


def _policy(wire: Wire) -> str:
    age = "any age" if wire.max_age is None else f"{wire.max_age:g} s"
    queue = "newest" if wire.queue == 1 else f"newest {wire.queue}"
    return f" ({queue}, {age})"


def as_mermaid(pipeline: Pipeline) -> str:
    """A Mermaid flow chart, as GitHub and GitLab show it in Markdown."""
    lines = ["flowchart LR"]
    wires = wires_of(pipeline)
    for host, processes in _groups(pipeline).items():
        if len(pipeline.hosts) > 1:
            lines.append(f'  subgraph host_{host}["{host}"]')
        for process, nodes in processes.items():
            shared = len(nodes) > 1
            lines += [f'  subgraph process_{host}_{process}["{process}"]'] if shared else []
            lines += [f'  node_{name}["{name}"]' for name in nodes]
            lines += ["  end"] if shared else []
        lines += ["  end"] if len(pipeline.hosts) > 1 else []
    lines += [
        f'  {_mermaid(wire.source)} -->|"{wire.key}"| node_{wire.target}'
        for wire in wires
        if wire.target
    ]
    return "\n".join(lines)


def _mermaid(name: str) -> str:
    return "outside([outside])" if name == OUTSIDE else f"node_{name}"


def _groups(pipeline: Pipeline) -> dict[str, dict[str, list[str]]]:
    groups: dict[str, dict[str, list[str]]] = {}
    for spec in pipeline.nodes:
        groups.setdefault(spec.host, {}).setdefault(spec.process, []).append(spec.name)
    return groups


def as_dot(pipeline: Pipeline) -> str:
    """A graph for Graphviz: `lodeline graph --dot | dot -Tpdf`."""
    lines = [f'digraph "{pipeline.name}" {{', "  rankdir=LR; node [shape=box, style=rounded];"]
    for host, processes in _groups(pipeline).items():
        nodes = " ".join(f'"{name}";' for names in processes.values() for name in names)
        if len(pipeline.hosts) > 1:
            nodes = f'subgraph "cluster_{host}" {{ label="{host}"; {nodes} }}'
        lines.append(f"  {nodes}")
    lines += [
        f'  "{wire.source}" -> "{wire.target}" [label="{wire.key}"];'
        for wire in wires_of(pipeline)
        if wire.target
    ]
    return "\n".join([*lines, "}"])


BOX_WIDE, BOX_HIGH, ROW, MARGIN, LETTER, LINE = 116, 34, 64, 24, 6.6, 15
STYLE = """\
  rect { fill: #f4f6f8; stroke: #33475b; stroke-width: 1.5; }
  path { fill: none; stroke: #0072b2; stroke-width: 1.5; }
  text { font: 13px system-ui, sans-serif; fill: #1b2733; text-anchor: middle; }
  .key { font-size: 11px; fill: #0072b2; paint-order: stroke; stroke: #fff; stroke-width: 4px; }"""


def as_svg(pipeline: Pipeline) -> str:
    """A picture of its own: layers from left to right, wires with their keys."""
    wires = [wire for wire in wires_of(pipeline) if wire.target]
    layers = layers_of(pipeline, wires)
    rows = max((len(layer) for layer in layers), default=1)
    step = BOX_WIDE + 44 + LETTER * max((len(wire.key) for wire in wires), default=0)
    places = {
        name: (
            MARGIN + step * column,
            MARGIN + ROW * (row + (rows - len(layer)) / 2) + (ROW - BOX_HIGH) / 2,
        )
        for column, layer in enumerate(layers)
        for row, name in enumerate(layer)
    }
    wide = 2 * MARGIN + step * (len(layers) - 1) + BOX_WIDE
    high = 2 * MARGIN + ROW * rows
    keys: dict[tuple[str, str], list[str]] = {}
    for wire in wires:
        keys.setdefault((wire.source, str(wire.target)), []).append(wire.key)
    body = [_svg_wire(places[a], places[b], labels) for (a, b), labels in keys.items()]
    body += [_svg_box(*place, name) for name, place in places.items()]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {high:.0f}" '
            f'width="{wide:.0f}" height="{high:.0f}" role="img">',
            f"<title>{escape(pipeline.name)}</title>",
            f"<style>\n{STYLE}\n</style>",
            *body,
            "</svg>",
        ]
    )


def _svg_wire(start: tuple[float, float], end: tuple[float, float], keys: list[str]) -> str:
    x0, y0 = start[0] + BOX_WIDE, start[1] + BOX_HIGH / 2
    x1, y1 = end[0], end[1] + BOX_HIGH / 2
    bend = (x1 - x0) / 2
    curve = f"M{x0:.0f},{y0:.0f} C{x0 + bend:.0f},{y0:.0f} {x1 - bend:.0f},{y1:.0f} "
    lines = [f'<path d="{curve}{x1:.0f},{y1:.0f}"/>']
    for place, key in enumerate(keys):
        y = (y0 + y1) / 2 + 4 + LINE * (place - (len(keys) - 1) / 2)
        lines.append(f'<text class="key" x="{(x0 + x1) / 2:.0f}" y="{y:.0f}">{escape(key)}</text>')
    return "\n".join(lines)


def _svg_box(x: float, y: float, name: str) -> str:
    box = f'<rect x="{x:.0f}" y="{y:.0f}" width="{BOX_WIDE}" height="{BOX_HIGH}" rx="6"/>'
    middle = f'x="{x + BOX_WIDE / 2:.0f}" y="{y + BOX_HIGH / 2 + 4:.0f}"'
    return f"{box}\n<text {middle}>{escape(name)}</text>"
