"""A pipeline file read, checked to the last word, and turned into its model."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lodeline.hosts.permits import ORDERS
from lodeline.loading import shipped
from lodeline.node import Driver, Input, Node
from lodeline.params import guess, nearest
from lodeline.pipeline.document import Item, is_file, parse, read_file
from lodeline.pipeline.draft import Draft, DraftNode, Wire, read_draft
from lodeline.pipeline.edge import Edge
from lodeline.pipeline.faults import Fault, PipelineError, Place
from lodeline.pipeline.model import NodeSpec, Pipeline
from lodeline.pipeline.programs import build_params, load_program
from lodeline.pipeline.wiring import check_wiring
from lodeline_msgs import Message

__all__ = ["Fault", "PipelineError", "find", "load", "load_unchanged"]

DEFAULT = "pipeline.yaml"


def find(name_or_path: str | None) -> Path:
    """The pipeline file that a user means: a path, the name of a shipped profile, or none.

    None is ./pipeline.yaml, or else the pipeline that ships with Lodeline. PipelineError if there
    is neither a file nor a profile of that name.
    """
    if name_or_path is None:
        here = Path(DEFAULT)
        return here if is_file(here) else shipped(DEFAULT)
    path = Path(name_or_path)
    if is_file(path):
        return path
    profiles = {
        file.stem.replace("_", "-"): file for file in sorted(shipped("profiles").glob("*.yaml"))
    }
    if name_or_path in profiles:
        return profiles[name_or_path]
    text = f"is neither a file nor a profile{nearest(name_or_path, profiles)}"
    if is_file(path / DEFAULT):
        text = f"is a folder, did you mean {path / DEFAULT}?"
    raise PipelineError([Fault(name_or_path, 0, 0, text)])


def load_unchanged(file: str, digest: str, overrides: Sequence[str]) -> Pipeline | None:
    """The pipeline behind what runs, unless its file was changed since."""
    try:
        pipeline = load(Path(file), overrides)
    except (PipelineError, OSError):
        return None
    return pipeline if pipeline.digest == digest else None


def load(file: Path, overrides: Sequence[str] = ()) -> Pipeline:
    """The pipeline in a file, with parameters overridden by `NODE.PARAM=VALUE` (VALUE is YAML).

    Raises PipelineError with everything that is wrong. Importing the node programs is part of it.
    """
    if not is_file(file):
        raise PipelineError([Fault(str(file), 0, 0, "there is no such file")])
    faults: list[Fault] = []
    document = read_file(file, faults)
    for override in overrides:
        _override(document, override, faults)
    draft = read_draft(document, faults)
    folder = file.resolve().parent
    programs = {
        node.name: found
        for node in draft.nodes
        if (found := load_program(node, folder, faults)) is not None
    }
    types = {name: cls for name, (_, cls) in programs.items()}
    params = {
        node.name: build_params(node, types[node.name], faults)
        for node in draft.nodes
        if node.name in types
    }
    order = check_wiring(draft, types, faults)
    _check_link(draft, document.place, faults)
    if faults:
        raise PipelineError(faults)
    specs = {
        node.name: _spec(draft.name, node, *programs[node.name], params[node.name])
        for node in draft.nodes
    }
    nodes = tuple(specs[name] for name in order)
    return Pipeline(
        name=draft.name,
        file=file.resolve(),
        digest=_digest(draft, nodes),
        clock=draft.clock,
        hosts=draft.hosts,
        nodes=nodes,
        external=_external(draft),
        warnings=(*draft.warnings, *_idle(draft, programs)),
        tls=None if draft.tls is None else file.resolve().parent / draft.tls,
        link_rate={f"{draft.name}/{key}": rate for key, rate in draft.link_rate.items()},
        overrides=tuple(overrides),
    )


def _override(document: Item, text: str, faults: list[Fault]) -> None:
    """Put the value of a `NODE.PARAM=VALUE` where the file would have it."""
    place = Place(f"--set {text}")
    target, equals, value = text.partition("=")
    name, *path = target.strip().split(".")
    if not (equals and name and path and all(path)):
        faults.append(place.fault("must be NODE.PARAM=VALUE"))
        return
    top = document.value if isinstance(document.value, dict) else {}
    nodes = top["nodes"].value if "nodes" in top else None
    node = nodes.get(name) if isinstance(nodes, dict) else None
    if node is None or not isinstance(node.value, dict):
        known = nodes if isinstance(nodes, dict) else {}
        faults.append(place.fault(f"unknown node {name!r}{nearest(name, known)}"))
        return
    try:
        found = parse(value, lambda _line, _column: place, faults)
    except PipelineError as error:
        faults.extend(error.faults)
        return
    group = node.value
    for step in ("params", *path[:-1]):
        if step not in group or group[step].value is None:
            group[step] = Item({}, node.place if step == "params" else place, place)
        if not isinstance(group[step].value, dict):
            faults.append(place.fault(f"{step} is a single value in the file"))
            return
        group = group[step].value
    group[path[-1]] = found or Item(None, place, place)


def _spec(name: str, node: DraftNode, file: Path, cls: type[Node[Any]], params: Any) -> NodeSpec:
    ports = cls.inputs()
    return NodeSpec(
        name=node.name,
        run=file,
        host=node.host or "",
        process=node.process,
        type=cls,
        params=params,
        inputs={wire.port: _edge(name, wire, ports[wire.port]) for wire in node.inputs},
        outputs={wire.port: f"{name}/{wire.key}" for wire in node.outputs},
        values=asdict(params),
        sends={wire.port: cls.outputs()[wire.port].message for wire in node.outputs},
        rates=node.rates,
        restart=node.restart or ("always" if issubclass(cls, Driver) else "limited"),
        restart_on_silence=node.restart_on_silence,
        required=node.required,
        priority=node.priority,
        cpu=node.cpu,
        rss_mb=node.rss_mb,
    )


def _edge(name: str, wire: Wire, port: Input[Any]) -> Edge:
    return Edge(
        key=f"{name}/{wire.key}",
        queue=wire.queue or port.queue,
        max_age=wire.max_age if wire.aged else port.max_age,
    )


def _external(draft: Draft) -> dict[str, type[Message]]:
    return {
        f"{draft.name}/{key}": message
        for key, message in draft.external.items()
        if message is not None
    }


def _check_link(draft: Draft, place: Place, faults: list[Fault]) -> None:
    """Keys that are to be sent more rarely, or may be sent by tools, must be there."""
    sent = [wire.key for node in draft.nodes for wire in node.outputs]
    for key, at in draft.places.items():
        if key not in sent:
            faults.append(at.fault(f"link_rate of {key!r}, which no node sends{guess(key, sent)}"))
    for host in draft.hosts.values():
        for key in host.grant:
            if key not in draft.external and key not in ORDERS:
                text = f"host {host.name!r} is granted {key!r}, which is no external key"
                faults.append(place.fault(text))


def _idle(draft: Draft, programs: Mapping[str, tuple[Path, type[Node[Any]]]]) -> Iterator[str]:
    """A word on each program that would end at once: what it is to do when it is run, is missing.

    Nodes that share a process are run by it.
    """
    alone = Counter((node.host, node.process) for node in draft.nodes)
    for node in draft.nodes:
        file, cls = programs[node.name]
        if alone[node.host, node.process] == 1 and b"__main__" not in file.read_bytes():
            text = (
                f"{node.run} never runs its node, end it with: "
                f'if __name__ == "__main__": from lodeline.process import run; run({cls.__name__})'
            )
            yield str(node.at("run").fault(text))


def _digest(draft: Draft, nodes: Sequence[NodeSpec]) -> str:
    """12 hex digits over what decides which samples come out: not comments, paths, priorities."""
    said = {
        "name": draft.name,
        "clock": draft.clock,
        "external": {key: message.__name__ for key, message in draft.external.items() if message},
        "nodes": [
            {
                "name": spec.name,
                "program": hashlib.sha256(spec.run.read_bytes()).hexdigest(),
                "host": spec.host,
                "process": spec.process,
                "params": spec.values,
                "inputs": {
                    port: (edge.key, edge.queue, edge.max_age) for port, edge in spec.inputs.items()
                },
                "outputs": spec.outputs,
            }
            for spec in nodes
        ],
    }
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:12]
