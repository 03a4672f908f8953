"""Who sends to whom: sources and classes of keys, ports, loops, order, shared processes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lodeline.node import Driver, Node
from lodeline.params import guess, nearest
from lodeline.pipeline.draft import Draft, DraftNode, Wire
from lodeline.pipeline.faults import Fault, Place
from lodeline_msgs import Message

Types = Mapping[str, type[Node[Any]]]
"""Node classes by the node's name; a node whose program could not be loaded is not in it."""


@dataclass(frozen=True, slots=True)
class Source:
    """Who sends a key: a node, or None for outside the file; its class, None if unknown."""

    node: str | None
    message: type[Message] | None


def check_wiring(draft: Draft, types: Types, faults: list[Fault]) -> list[str]:
    """Names of the nodes in the order in which data flow; all that is wrong goes to `faults`."""
    sources = _sources(draft, types, faults)
    for node in draft.nodes:
        if node.name in types:
            _check_ports(node, types[node.name], faults)
            _check_inputs(node, types[node.name], draft, sources, faults)
        else:
            for wire in node.inputs:
                _check_source(wire, draft, sources, faults)
    _check_processes(draft, faults)
    return _flow(draft, types, sources, faults)


def _sources(draft: Draft, types: Types, faults: list[Fault]) -> dict[str, Source]:
    sources = {key: Source(None, message) for key, message in draft.external.items()}
    for node in draft.nodes:
        ports = types[node.name].outputs() if node.name in types else {}
        for wire in node.outputs:
            rival = sources.get(wire.key)
            if rival is not None:
                faults.append(wire.place.fault(_rivals(wire.key, rival.node, node.name)))
                continue
            message = ports[wire.port].message if wire.port in ports else None
            sources[wire.key] = Source(node.name, message)
    return sources


def _rivals(key: str, first: str | None, second: str) -> str:
    if first is None:
        return f"key {key!r} is external, so node {second!r} cannot send it"
    if first == second:
        return f"key {key!r} has two sources: two ports of node {first!r}"
    return f"key {key!r} has two sources: nodes {first!r} and {second!r}"


def _check_ports(node: DraftNode, cls: type[Node[Any]], faults: list[Fault]) -> None:
    wired = {wire.port for wire in node.outputs}
    inputs, outputs = list(cls.inputs()), list(cls.outputs())
    for what, wires, ports, other, others in (
        ("input", node.inputs, inputs, "output", outputs),
        ("output", node.outputs, outputs, "input", inputs),
    ):
        for wire in wires:
            if wire.port not in ports:
                hint = nearest(wire.port, ports) or " (it has none)"
                hint = f", it is an {other} port" if wire.port in others else hint
                text = f"{cls.__name__} has no {what} port {wire.port!r}{hint}"
                faults.append(wire.port_place.fault(text))
    for port in node.rates:
        if port not in wired:
            place = node.items["rate"].value[port].key
            text = f"rate of {port!r}, which is no wired output port{guess(port, wired)}"
            faults.append(place.fault(text))
    said = node.items["inputs"].value if "inputs" in node.items else None
    if inputs and not said and not issubclass(cls, Driver):
        text = f"no input port of node {node.name!r} is wired (it has: {', '.join(inputs)})"
        faults.append(node.place.fault(text))


def _check_inputs(
    node: DraftNode,
    cls: type[Node[Any]],
    draft: Draft,
    sources: Mapping[str, Source],
    faults: list[Fault],
) -> None:
    for wire in node.inputs:
        source = _check_source(wire, draft, sources, faults)
        port = cls.inputs().get(wire.port)
        if source is None or source.message is None or port is None:
            continue
        if not issubclass(source.message, port.message):
            sender = f"node {source.node!r}" if source.node else "external"
            text = f"key {wire.key!r} carries {source.message.__name__} ({sender}), but input"
            takes = f"{wire.port!r} of {cls.__name__} takes {port.message.__name__}"
            faults.append(wire.place.fault(f"{text} {takes}"))


def _check_source(
    wire: Wire, draft: Draft, sources: Mapping[str, Source], faults: list[Fault]
) -> Source | None:
    source = sources.get(wire.key)
    if source is None:
        text = f"nobody sends {wire.key!r}"
        if wire.key.removeprefix(f"{draft.name}/") in sources:
            text += f", keys stand here without {draft.name + '/'!r}"
        else:
            text += nearest(wire.key, sources)
        faults.append(wire.place.fault(text))
    return source


def _check_processes(draft: Draft, faults: list[Fault]) -> None:
    first: dict[str, DraftNode] = {}
    names = {node.name: node for node in draft.nodes}
    for node in draft.nodes:
        lone = names.get(node.process)
        if lone is not None and lone.process != node.process:
            lone = None
        leader = first.setdefault(node.process, lone or node)
        if leader is node:
            continue
        place = node.at("process")
        text = f"nodes {leader.name!r} and {node.name!r} share process {node.process!r}"
        if leader.host and node.host and leader.host != node.host:
            faults.append(
                place.fault(f"{text}, but run on hosts {leader.host!r} and {node.host!r}")
            )
        for key in ("restart", "priority", "cpu", "rss_mb"):
            ours, theirs = getattr(node, key), getattr(leader, key)
            if ours is not None and theirs is not None and ours != theirs:
                hint = f"but {leader.name!r} has {key}: {theirs}"
                faults.append(node.at(key).fault(f"{text}, {hint}"))


def _flow(
    draft: Draft, types: Types, sources: Mapping[str, Source], faults: list[Fault]
) -> list[str]:
    """Sources first, then by the longest way from them; equals in the order of the file."""
    before: dict[str, dict[str, Place]] = {}  # who must stand before a node, and why
    for node in draft.nodes:
        before[node.name] = {}
        if node.name in types and not issubclass(types[node.name], Driver):
            for wire in node.inputs:
                source = sources.get(wire.key)
                if source is not None and source.node is not None:
                    before[node.name].setdefault(source.node, wire.place)
    order: list[str] = []
    waiting = list(before)
    while waiting:
        ready = [name for name in waiting if not before[name].keys() & set(waiting)]
        if not ready:
            loop = _loop(before, waiting)
            text = f"cycle: {' -> '.join([*loop, loop[0]])}"
            faults.append(before[loop[0]].pop(loop[-1]).fault(text))
        order += ready
        waiting = [name for name in waiting if name not in ready]
    return order


def _loop(before: Mapping[str, Mapping[str, Place]], waiting: list[str]) -> list[str]:
    """A loop among nodes that all wait for another, as data flow, from the first in the file."""
    path = [waiting[0]]
    while True:
        sender = next(name for name in before[path[-1]] if name in waiting)
        if sender in path:
            loop = path[path.index(sender) :][::-1]
            start = loop.index(min(loop, key=waiting.index))
            return loop[start:] + loop[:start]
        path.append(sender)
