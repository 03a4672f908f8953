"""What a restarted node missed: its senders kept it (`lodeline.recent`), and hand it over.

Without them an attitude that lost half a second of gyro would have to look for north anew.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

import msgpack

from lodeline.inlet import Inlet
from lodeline.recent import NEWEST, recent_key
from lodeline_msgs import DecodeError, Message

PATIENCE_S = 0.5
ANSWER_S = 0.15
"""A question on a link that has just come up can get lost; then it is put again, not waited for."""
LONGEST_HOLD_S = 1.0
TRY_AGAIN_S = 0.01

Ask = Callable[[str, float], list[tuple[str, bytes]]]


class _Sample(NamedTuple):
    stamp: int
    edge: int
    data: bytes
    source: str
    missed: bool


class Missed:
    """The inputs of restored nodes, held until they have got what they missed."""

    def __init__(self) -> None:
        self._edges: list[tuple[Inlet[Any], int]] = []
        self._since = time.monotonic()
        self.gone: list[str] = []  # keys of which more was missed than their sender keeps

    def hold(self, inlet: Inlet[Any], mark: int) -> None:
        """Let live samples wait; the predecessor's state has all up to the stamp `mark` in it."""
        inlet.hold()
        self._edges.append((inlet, mark))

    def __bool__(self) -> bool:
        return bool(self._edges)

    def unheard(self) -> list[str]:
        """Keys of which nothing new has come yet."""
        return [inlet.key for inlet, _ in self._edges if not inlet.waiting]

    def due(self) -> bool:
        """Whether it is time to catch up: every sender is heard again, or one is long silent."""
        if not self._edges:
            return False
        late = time.monotonic() - self._since > LONGEST_HOLD_S
        return late or not self.unheard()

    def catch_up(
        self, ask: Ask, lock: AbstractContextManager[Any], mute: Callable[[bool], None]
    ) -> int:
        """Hand over what was missed, muted, then what waited, in the order of stamps; how many.

        `ask(key, seconds)` gives the answers to a query that come in time; `lock` keeps live
        samples out meanwhile.
        """
        answers = self._ask_all(ask)
        with lock:
            samples = [*self._missed(answers)]
            known = {(sample.edge, sample.data) for sample in samples}
            for edge, (inlet, _) in enumerate(self._edges):
                for data, source in inlet.let_go():
                    if (edge, data) not in known:
                        samples.append(_Sample(_stamp(inlet, data), edge, data, source, False))
            samples.sort(key=lambda sample: sample.stamp)
            for sample in samples:
                mute(sample.missed)
                inlet = self._edges[sample.edge][0]
                inlet.take(sample.data, sample.source, missed=sample.missed)
            mute(False)
        self._edges = []
        return sum(sample.missed for sample in samples)

    def _ask_all(self, ask: Ask) -> Mapping[int, bytes]:
        """Answers by edge. A sender's offer may need a moment to be known here."""
        found: dict[int, bytes] = {}
        end = time.monotonic() + PATIENCE_S
        while True:
            for edge, (inlet, _) in enumerate(self._edges):
                if edge not in found:
                    for _, data in ask(recent_key(inlet.key), ANSWER_S):
                        found[edge] = data
            if len(found) == len(self._edges) or time.monotonic() > end:
                return found
            time.sleep(TRY_AGAIN_S)

    def _missed(self, answers: Mapping[int, bytes]) -> list[_Sample]:
        samples = []
        for edge, answer in answers.items():
            inlet, mark = self._edges[edge]
            try:
                source, kept = msgpack.unpackb(answer)
                if len(kept) >= NEWEST and mark < _stamp(inlet, kept[0]):
                    self.gone.append(inlet.key)
                for data in kept:
                    stamp = _stamp(inlet, data)
                    if mark < stamp:
                        samples.append(_Sample(stamp, edge, data, source, True))
            except (ValueError, TypeError) as error:
                print(f"MISSED {inlet.key}: {error}", file=sys.stderr, flush=True)
        return samples


def _stamp(inlet: Inlet[Any], data: bytes) -> int:
    """When a sample was measured; 0 for one that its inlet will refuse."""
    try:
        message: Message = inlet.unpack(data)
    except DecodeError:
        return 0
    return message.stamp
