"""Where samples enter a process: bytes are checked, gaps counted, old samples refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from lodeline.clock import Clock
from lodeline_msgs import DecodeError, Message, unpack

M = TypeVar("M", bound=Message)


class Inlet(Generic[M]):
    """One edge into one port.

    A number that was seen or overtaken is refused as `duplicate` or `reordered`, unless the
    sample was measured later than all before it: then its sender was restarted and counts anew.
    Samples older than `max_age` seconds are refused as late.
    """

    def __init__(
        self,
        key: str,
        message: type[M],
        max_age: float | None,
        clock: Clock,
        reject: Callable[[str], None],
        deliver: Callable[[M], None],
    ) -> None:
        self.key = key
        self.received = 0
        self.lost = 0
        self.late = 0
        self.last_error = ""
        self._ages: list[float] = []
        self._message = message
        self._limit = None if max_age is None else int(max_age * 1e9)
        self._clock = clock
        self._reject = reject
        self._deliver = deliver
        self._last_seq = -1
        self._last_stamp = 0

    def take(self, data: bytes) -> None:
        """One sample from the bus; whatever it is, this returns."""
        try:
            message = unpack(data, self._message)
        except DecodeError as error:
            self._reject("undecodable")
            self.last_error = str(error)
            return
        if not self._in_order(message.seq, message.stamp):
            return
        self._clock.saw(message.stamp)
        age = self._clock.now() - message.stamp
        self._ages.append(age * 1e-9)
        if self._limit is not None and age > self._limit:
            self.late += 1
            return
        self.received += 1
        self._deliver(message)

    def _in_order(self, seq: int, stamp: int) -> bool:
        last = self._last_seq
        if seq <= last and stamp <= self._last_stamp:
            self._reject("duplicate" if seq == last else "reordered")
            return False
        if seq > last + 1 and last >= 0:
            self.lost += seq - last - 1
        self._last_seq = seq
        self._last_stamp = stamp
        return True

    def drain_ages(self) -> list[float]:
        """Ages on arrival [s] since the last call, sorted."""
        ages, self._ages = self._ages, []
        return sorted(ages)


def counts(inlets: list[Inlet[Any]], name: str) -> dict[str, int]:
    """A counter of each inlet by key, edges to the same key added up."""
    total: Counter[str] = Counter()
    for inlet in inlets:
        total[inlet.key] += getattr(inlet, name)
    return dict(total)
