"""What a process finds wrong with its nodes, and when that is worth a line in the log."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

SEVERITY = ("running", "degraded", "fault")
"""States of a node: well; usable, but less accurate; not usable."""
TOLERANCE = 0.2
WINDOW_S = 5.0
WINDOW_PERIODS = 15
SILENT_PERIODS = 10
SHORTEST_SILENCE_S = 0.25
"""Shorter pauses are the machine's more often than the node's."""
REPEAT_S = 30.0


class Complaint(NamedTuple):
    """How bad it is, what it is about (`RATE rover/odom`), and the rest of the sentence."""

    state: str
    what: str
    text: str

    def __str__(self) -> str:
        return f"{self.what}: {self.text}"


def worst(states: Iterable[str]) -> str:
    """The gravest of some states."""
    return max(states, key=lambda state: SEVERITY.index(state) if state in SEVERITY else 0)


class Pace:
    """Whether an output keeps the rate that the pipeline file expects of it.

    A rate is off when it differs by more than a fifth over five seconds (15 periods of a slow
    output); an output is silent when nothing came for ten periods. Nothing is said before such a
    time has passed since the start. Times are seconds on a steady clock.
    """

    def __init__(self, key: str, expected: float, now: float) -> None:
        self._key = key
        self._expected = expected
        self._began = now
        self._window = max(WINDOW_S, WINDOW_PERIODS / expected)
        self._seen: deque[tuple[float, int]] = deque([(now, 0)])

    def judge(self, now: float, total: int, last: float) -> Complaint | None:
        """Look at the samples sent so far, the last of them at `last`; once a second."""
        seen, expected = self._seen, self._expected
        seen.append((now, total))
        while len(seen) > 2 and now - seen[1][0] >= self._window:
            seen.popleft()
        since, before = seen[0]
        if now - self._began < self._window:
            return None
        silent = now - max(last, self._began)
        if silent > max(SILENT_PERIODS / expected, SHORTEST_SILENCE_S):
            text = f"nothing for {silent:.1f} s, {expected:g} Hz declared"
            return Complaint("fault", f"NO_DATA {self._key}", text)
        rate = (total - before) / (now - since)
        if abs(rate - expected) > TOLERANCE * expected:
            text = f"{rate:.1f} Hz, {expected:g} declared"
            return Complaint("degraded", f"RATE {self._key}", text)
        return None


class Gossip:
    """Decides which complaints are news: at most one line every 30 s about the same thing."""

    def __init__(self) -> None:
        self._told: dict[str, float] = {}

    def news(self, complaints: Iterable[Complaint], now: float) -> list[str]:
        """Lines for the log."""
        lines = []
        self._told = {what: then for what, then in self._told.items() if now - then < REPEAT_S}
        for complaint in complaints:
            if complaint.what not in self._told:
                self._told[complaint.what] = now
                lines.append(str(complaint))
        return lines
