"""A pipeline as a graph: boxes for nodes, wires for keys, in layers along the data flow."""

from __future__ import annotations

from dataclasses import dataclass

from lodeline.pipeline.model import Pipeline

OUTSIDE = "(outside)"


@dataclass(frozen=True, slots=True)
class Wire:
    """A key on its way from a node to a reader; `target` is None if nobody reads it.

    `queue` samples may wait at the reader, none older than `max_age` [s].
    """

    key: str
    type: str
    source: str
    target: str | None
    rate: float | None = None
    queue: int | None = None
    max_age: float | None = None


def wires_of(pipeline: Pipeline) -> list[Wire]:
    """All wires, in the order in which data flow; keys without the pipeline's name."""
    prefix = f"{pipeline.name}/"
    readers = [(spec.name, edge) for spec in pipeline.nodes for edge in spec.inputs.values()]
    rates = {
        key: spec.rates.get(port) for spec in pipeline.nodes for port, key in spec.outputs.items()
    }
    sources = {key: spec.name for spec in pipeline.nodes for key in spec.outputs.values()}
    wires = []
    for key, cls in pipeline.key_types().items():
        where = (key.removeprefix(prefix), cls.__name__, sources.get(key, OUTSIDE))
        edges = [(node, edge) for node, edge in readers if edge.key == key]
        wires += [
            Wire(*where, node, rates.get(key), edge.queue, edge.max_age) for node, edge in edges
        ]
        if not edges:
            wires.append(Wire(*where, None, rates.get(key)))
    return wires


def layers_of(pipeline: Pipeline, wires: list[Wire]) -> list[list[str]]:
    """Nodes by their longest way from a source, each layer in an order that crosses few wires."""
    depth = {spec.name: 0 for spec in pipeline.nodes}
    if any(wire.source == OUTSIDE for wire in wires):
        depth = {OUTSIDE: 0} | depth
    for name in depth:  # nodes stand in the order in which data flow
        before = [depth[wire.source] for wire in wires if wire.target == name]
        depth[name] = max(before, default=-1) + 1
    layers: list[list[str]] = [[] for _ in range(max(depth.values(), default=-1) + 1)]
    for name, place in depth.items():
        layers[place].append(name)
    height: dict[str, float] = {}
    for layer in layers:
        for name in layer:
            above = [height[wire.source] for wire in wires if wire.target == name]
            height[name] = sum(above) / len(above) if above else float(layer.index(name))
        layer.sort(key=lambda name: height[name])
        height |= {name: place - (len(layer) - 1) / 2 for place, name in enumerate(layer)}
    return layers
