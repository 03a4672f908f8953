"""The newest log lines of all supervisors of a pipeline, each once."""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Iterable

KEPT = 400
BATCH = 100
MAX_TEXT = 500

Line = tuple[float, str, str]
"""UNIX time [s], the process that printed it, what it printed."""


class Tail:
    """Takes batches of lines from any thread; pages read on from the line they have.

    Nothing is shown before `begin` has told what the supervisors had kept.
    """

    def __init__(self) -> None:
        self._lines: deque[Line] = deque(maxlen=KEPT)
        self._count = 0
        self._newest: dict[str, tuple[int, float]] = {}
        self._early: deque[tuple[str, bytes]] | None = deque(maxlen=64)
        self._lock = threading.Lock()

    def take(self, key: str, data: bytes, _encoding: str) -> None:
        """A batch of new lines; `key` tells of which supervisor."""
        with self._lock:
            if self._early is not None:
                self._early.append((key, data))
            else:
                self._add(key, data)

    def begin(self, kept: Iterable[tuple[str, bytes]]) -> None:
        """What the supervisors had kept, by key, and after it what came in meanwhile."""
        with self._lock:
            early, self._early = self._early or (), None
            for key, data in (*kept, *early):
                self._add(key, data)

    def _add(self, key: str, data: bytes) -> None:
        try:
            batch = [
                (int(line["n"]), (float(line["time"]), str(line["name"]), str(line["text"])))
                for line in json.loads(data)
            ]
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return  # of another version: the terminal still has them
        for number, (at, name, text) in batch:
            newest, latest = self._newest.get(key, (-1, at))
            if number > newest or at > latest:  # a supervisor that was started again counts anew
                self._newest[key] = number, at
                self._lines.append((at, name, text[:MAX_TEXT]))
                self._count += 1

    def since(self, count: int) -> tuple[int, list[Line]]:
        """Lines after the first `count`, at most a batch of them, and the count with these."""
        with self._lock:
            first = max(count, self._count - len(self._lines))
            start = first - (self._count - len(self._lines))
            lines = list(self._lines)[start : start + BATCH]
        return first + len(lines), lines
