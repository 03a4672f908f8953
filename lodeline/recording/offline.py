"""Replay without a clock: a pipeline's nodes, chained in one process, over a recording.

Drivers stay out, what they sent is in the recording; all that the other nodes send is computed
anew. The same recording and the same pipeline give the same bytes, as fast as the machine goes.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lodeline.graph import Graph
from lodeline.keys import is_truth
from lodeline.node import Context, Node
from lodeline.pipeline.model import NodeSpec, Pipeline
from lodeline.recording import RecordingError
from lodeline.recording.read import Recording
from lodeline_msgs import Message, packer_of

Listener = Callable[[str, Message, int], None]
"""Key, message, and the log time [ns] of the recorded sample that led to it."""
FAULTS_KEPT = 5


@dataclass(slots=True)
class Traffic:
    """What went over one key; `source` is the node that sent it, None for the recording."""

    source: str | None
    samples: int = 0
    first: int = 0
    last: int = 0

    def count(self, stamp: int) -> None:
        """Note a sample of this stamp [ns]."""
        if self.samples == 0:
            self.first = stamp
        self.samples += 1
        self.last = stamp

    @property
    def rate(self) -> float:
        """Mean rate [Hz] by the stamps, 0 for less than two samples."""
        span = self.last - self.first
        return (self.samples - 1) / (span * 1e-9) if span > 0 else 0.0


@dataclass(slots=True)
class Outcome:
    """Traffic by key, SHA-256 of all that was sent, exceptions by node and the first of them;
    `said` counts what nodes had to say of themselves.
    """

    traffic: dict[str, Traffic]
    digest: str = ""
    failed: dict[str, int] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    said: Counter[str] = field(default_factory=Counter)


class Replay:
    """The wiring of a pipeline for one replay; `inputs` are the keys that it takes, `outputs`
    those that it computes, both with their class and without the pipeline's name.
    """

    def __init__(self, pipeline: Pipeline) -> None:
        self._prefix = f"{pipeline.name}/"
        self._specs = [spec for spec in pipeline.nodes if not spec.is_driver]
        self.outputs: dict[str, type[Message]] = {}
        self._sources: dict[str, str] = {}
        for spec in self._specs:
            ports = spec.type.outputs()
            for port, key in spec.outputs.items():
                self.outputs[self._short(key)] = ports[port].message
                self._sources[self._short(key)] = spec.name
        self.inputs: dict[str, type[Message]] = {}
        for spec in self._specs:
            ports_in = spec.type.inputs()
            for port, edge in spec.inputs.items():
                if (key := self._short(edge.key)) not in self.outputs:
                    self.inputs[key] = ports_in[port].message

    def check(self, recording: Recording) -> None:
        """RecordingError if the recording lacks a needed key, or has another class on it."""
        channels = recording.channels
        missing = [
            f"{key} ({cls.__name__})" for key, cls in self.inputs.items() if key not in channels
        ]
        if missing:
            there = ", ".join(f"{info.key} ({info.type_name})" for info in channels.values())
            raise RecordingError(
                f"{recording.path} lacks {', '.join(missing)}; it has {there or 'no keys at all'}"
            )
        for key, cls in self.inputs.items():
            if channels[key].type is not cls:
                raise RecordingError(
                    f"{recording.path}: {key} is {channels[key].type_name}, "
                    f"the pipeline takes {cls.__name__}"
                )

    def told(self, recording: Recording) -> dict[str, type[Message]]:
        """Keys on which the recording has the truth: no node takes it, but results are held
        against it.
        """
        mine = self.inputs | self.outputs
        return {
            key: info.type
            for key, info in recording.channels.items()
            if info.type is not None and is_truth(key) and key not in mine
        }

    def run(
        self, recording: Recording, run_folder: Path, listeners: Sequence[Listener] = ()
    ) -> Outcome:
        """Replay the whole recording; listeners get inputs and outputs alike, and the truth.

        The digest is of key and packed bytes of everything sent, in the order of sending.
        """
        self.check(recording)
        keys = [*self.inputs, *self.outputs]
        outcome = Outcome({key: Traffic(self._sources.get(key)) for key in keys})
        digest = hashlib.sha256()
        graph = self._graph(run_folder, outcome)
        pending: list[tuple[str, Message]] = []

        def tap(key: str, cls: type[Message]) -> Callable[[Message], None]:
            name, count, packed = key.encode(), outcome.traffic[key].count, packer_of(cls)

            def sent(message: Message) -> None:
                update(name + packed(message))
                count(message.stamp)
                if listeners:
                    pending.append((key, message))

            return sent

        update = digest.update
        for key, cls in self.outputs.items():
            graph.tap(key, tap(key, cls))
        try:
            told = self.told(recording)
            for key, message, log_time in recording.samples([*self.inputs, *told]):
                if key in told:
                    for listener in listeners:
                        listener(key, message, log_time)
                    continue
                outcome.traffic[key].count(message.stamp)
                graph.deliver(key, message)
                if not listeners:
                    continue
                # Listeners are told when the nodes are done: their errors are none of a node's.
                for each, what in ((key, message), *pending):
                    for listener in listeners:
                        listener(each, what, log_time)
                pending.clear()
        finally:
            graph.close()
        outcome.digest = digest.hexdigest()
        return outcome

    def _graph(self, run_folder: Path, outcome: Outcome) -> Graph:
        def failed(name: str, message: Message, error: Exception) -> None:
            outcome.failed[name] = outcome.failed.get(name, 0) + 1
            if len(outcome.faults) < FAULTS_KEPT:
                outcome.faults.append(f"{name}: {type(error).__name__}: {error} at {message}")

        return Graph(
            {spec.name: _make(spec, run_folder, outcome.said) for spec in self._specs},
            {
                spec.name: {port: self._short(edge.key) for port, edge in spec.inputs.items()}
                for spec in self._specs
            },
            {
                spec.name: {port: self._short(key) for port, key in spec.outputs.items()}
                for spec in self._specs
            },
            failed,
        )

    def _short(self, key: str) -> str:
        return key.removeprefix(self._prefix)


def _make(spec: NodeSpec, run_folder: Path, said: Counter[str]) -> Node[Any]:
    def say(text: str) -> None:
        said[f"{spec.name}: {text}"] += 1

    return spec.type(spec.params, Context(spec.name, run_folder, say=say))
