"""How far another host's clock is ahead of ours, from questions and answers, with an error bar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

DRIFT = 100e-6
"""How fast two clocks may part [s/s]: twice what a cheap crystal does."""


@dataclass(frozen=True, slots=True)
class Offset:
    """Their clock less ours, true to within `error` at the instant `at` of our monotonic clock."""

    seconds: Annotated[float, "s"]
    error: Annotated[float, "s"]
    at: Annotated[int, "ns"]

    def aged(self, now: int) -> float:
        """The error bar [s] at a later instant [ns, monotonic]."""
        return self.error + DRIFT * (now - self.at) * 1e-9


def measured(sent: int, answered: int, received: int, at: int) -> Offset:
    """From one question [ns]: when it left and came back by our clock, answered by theirs.

    The answer was given somewhere between the two: half the round trip is the bar, however
    unlike the ways there and back are.
    """
    middle = (sent + received) // 2
    return Offset((answered - middle) * 1e-9, 0.5 * (received - sent) * 1e-9, at)


def better(known: Offset | None, new: Offset, now: int) -> Offset:
    """The one with the smaller bar now [ns, monotonic]; the new one if they exclude each other."""
    if known is None or new.error <= known.aged(now):
        return new
    if abs(new.seconds - known.seconds) > new.error + known.aged(now):
        return new  # a clock was set, or another machine answers
    return known


STEP = 1e-3
"""Nodes are told of a change of the other clock only beyond its error bar and this [s]."""


class NodeTime:
    """The time that the nodes of a host go by: that of the `reference` host, once it is known.

    All ages and age limits are then of one clock, however far off this host's own may be.
    `own` is UNIX time here less monotonic time here [ns], as taken at the start.
    """

    def __init__(self, own: int, reference: str | None) -> None:
        self._own = own
        self._reference = reference
        self._now = own

    def epoch(self) -> int:
        """UNIX time there less monotonic time here [ns]."""
        return self._now

    def follow(self, host: str, offset: Offset) -> bool:
        """Take in a measurement; whether the nodes have to be told."""
        if host != self._reference:
            return False
        wanted = self._own + round(offset.seconds * 1e9)
        if abs(wanted - self._now) <= 1e9 * (offset.error + STEP):
            return False
        self._now = wanted
        return True
