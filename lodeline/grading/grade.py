"""Grading: the student's node and the reference over the same simulated drive, side by side."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

from lodeline import virtual
from lodeline.grading.exercise import Exercise, Quantity
from lodeline.grading.hint import hint
from lodeline.grading.patience import GradingError, patience, where
from lodeline.graph import Graph
from lodeline.loading import load_node, shipped
from lodeline.node import Node
from lodeline.pipeline.load import load
from lodeline.pipeline.model import Pipeline
from lodeline.rotation import wrap_angle
from lodeline_msgs import Message

SECONDS = 20.0
"""Of driving: a straight, turns both ways, a bump."""
Samples = list[tuple[str, Message]]
Sent = dict[tuple[int, int, int], Message]
"""What a node sent, by the drive, the stamp since its start [ns] and the number at that stamp."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The worst of one quantity: how far off, and when [s since the start].

    NaN: it is no number then. Infinite: no sample has a stamp that was asked for.
    """

    quantity: Quantity
    worst: float
    seconds: float

    @property
    def fine(self) -> bool:
        """Whether it is exact enough."""
        return self.worst <= self.quantity.tolerance


@dataclass(frozen=True, slots=True)
class Grade:
    """What came out: samples asked for and sent, differences, the first exception, a hint."""

    wanted: int
    sent: int
    differences: tuple[Difference, ...]
    raised: str
    hint: str

    @property
    def passed(self) -> bool:
        """Whether every sample is there and right."""
        complete = self.sent == self.wanted and not self.raised
        return complete and all(difference.fine for difference in self.differences)


def grade(exercise: Exercise, file: Path, seeds: Iterable[int] = (1, 2)) -> Grade:
    """Hold the node in `file` against the reference; GradingError if it is no such node.

    Every seed is another drive: other noise, other slip of the wheels.
    """
    reference = load_node(exercise.file)
    drives = [_drive(tuple(exercise.inputs.items()), seed) for seed in seeds]
    right = _run(exercise, reference, drives)
    with patience(file):
        node = _load(file, reference)
        try:
            answer = _run(exercise, node, drives)
        except Exception as error:
            raise GradingError(f"{file} does not start: {where(error, file)}") from None
        differences = _differences(exercise, answer.sent, right.sent)
        found = Grade(len(right.sent), len(answer.sent), differences, answer.raised, "")
        if found.passed:
            return found
        written, solved = (sys.modules[each.__module__] for each in (node, reference))
        return replace(found, hint=hint(exercise.parts, written, solved))


def _load(file: Path, reference: type[Node[Any]]) -> type[Node[Any]]:
    if not file.is_file():
        raise GradingError(f"{file}: there is no such file")
    try:
        node = load_node(file)
    except Exception as error:
        raise GradingError(f"{file} does not load: {where(error, file)}") from None
    for kind, ports in (("input", reference.inputs()), ("output", reference.outputs())):
        there = node.inputs() if kind == "input" else node.outputs()
        for name, port in ports.items():
            if name not in there or there[name].message is not port.message:
                text = f"{kind} {name} of {port.message.__name__}"
                raise GradingError(f"{file}: {node.__name__} has no {text}: leave the ports alone")
    return node


@cache
def _drive(ports: tuple[tuple[str, str], ...], seed: int) -> Samples:
    """What an exercise's ports get from the default pipeline with another simulated drive."""
    pipeline = load(shipped("pipeline.yaml"), [f"simulator.robot.seed={seed}"])
    wanted = {f"{pipeline.name}/{key}": port for port, key in ports}
    taken: Samples = []

    def take(key: str, message: Message) -> None:
        if key in wanted:
            taken.append((wanted[key], message))

    with tempfile.TemporaryDirectory(prefix="ll") as folder:
        virtual.run(_upstream(pipeline, set(wanted)), SECONDS, Path(folder), take)
    return taken


def _upstream(pipeline: Pipeline, keys: set[str]) -> Pipeline:
    """Only what has a part in some keys: the simulated robot, and the nodes on the way to them."""
    kept = []
    for spec in reversed(pipeline.nodes):
        if spec.is_driver or keys & set(spec.outputs.values()):
            keys = keys | {edge.key for edge in spec.inputs.values()}
            kept.append(spec)
    return replace(pipeline, nodes=tuple(reversed(kept)))


@dataclass(frozen=True, slots=True)
class _Outcome:
    sent: Sent
    raised: str


def _run(exercise: Exercise, cls: type[Node[Any]], drives: Sequence[Samples]) -> _Outcome:
    """What a node sends over all drives, and the first thing that it raised."""
    sent: Sent = {}
    raised: list[str] = []
    file = Path(sys.modules[cls.__module__].__file__ or "")

    def fail(_name: str, message: Message, error: Exception) -> None:
        if not raised:
            raised.append(f"{where(error, file)}, at {message}")

    for number, samples in enumerate(drives):
        start = samples[0][1].stamp
        ports = {port: port for port in exercise.inputs}
        node = cls(cls.params_type()())
        graph = Graph({"node": node}, {"node": ports}, {"node": {exercise.output: "out"}}, fail)

        def keep(message: Message, drive: int = number, start: int = start) -> None:
            same = 0
            while (drive, message.stamp - start, same) in sent:
                same += 1
            sent[drive, message.stamp - start, same] = message

        graph.tap("out", keep)
        for port, message in samples:
            graph.deliver(port, message)
        graph.close()
    return _Outcome(sent, raised[0] if raised else "")


def _differences(exercise: Exercise, answer: Sent, right: Sent) -> tuple[Difference, ...]:
    found = []
    for quantity in exercise.quantities:
        both = answer.keys() & right.keys()
        worst, when = 0.0 if both else inf, 0.0
        for place in sorted(both):
            off = quantity.of(answer[place]) - quantity.of(right[place])
            off = abs(wrap_angle(off) if quantity.angle and isfinite(off) else off)
            if not off <= worst:
                worst, when = off, place[1] * 1e-9
            if not isfinite(off):  # as far off as can be
                worst = nan
                break
        found.append(Difference(quantity, worst, when))
    return tuple(found)
