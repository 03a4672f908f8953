"""Log lines of a running pipeline, the kept ones and the new ones, each once and in order."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Iterable, Sequence, Set
from itertools import cycle
from typing import Any

from lodeline.watch import Watch

OURS = "lodeline"
"""The name under which a supervisor prints."""
COLOURS = (1, 36, 32, 35, 34, 33, 96, 92, 95)
Line = dict[str, Any]


class Lines:
    """Reads what supervisors keep and publish; numbers tell which lines were seen already.

    `came` is set while new ones wait.
    """

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._lock = threading.Lock()
        self._next: dict[str, int] = {}
        self._waiting: dict[str, list[Line]] = {}
        self.came = threading.Event()

    def follow(self) -> None:
        """Listen; to be called before `kept`, so that nothing falls between."""
        self._watch.subscribe(f"{self._watch.manifest.name}/@log/*", 256, self._on_lines)

    def kept(self) -> list[Line]:
        """Lines that the supervisors keep, and that were not given out before."""
        return self._in_order(self._watch.ask("@log").items())

    def new(self) -> list[Line]:
        """Lines that came since; what was missed on the way is asked for again."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
            self.came.clear()
        missed = self.kept() if any(self._gap(*item) for item in waiting.items()) else []
        return [*missed, *self._in_order(waiting.items())]

    def _gap(self, host: str, lines: list[Line]) -> bool:
        expected = self._next.get(host, 0)
        for line in lines:
            if line["n"] > expected:
                return True
            expected = max(expected, line["n"] + 1)
        return False

    def _on_lines(self, key: str, data: bytes, _encoding: str) -> None:
        with self._lock:
            self._waiting.setdefault(key.rpartition("/")[2], []).extend(json.loads(data))
            self.came.set()

    def _in_order(self, answers: Iterable[tuple[str, list[Line]]]) -> list[Line]:
        fresh: list[Line] = []
        for host, lines in answers:
            for line in lines:
                if line["n"] >= self._next.get(host, 0):
                    self._next[host] = line["n"] + 1
                    fresh.append({**line, "host": host})
        return sorted(fresh, key=lambda line: line["time"])


def is_about(line: Line, wanted: Set[str]) -> bool:
    """Whether one of the wanted processes printed it, or the supervisor names one in it."""
    if not wanted or line["name"] in wanted:
        return True
    return line["name"] == OURS and not wanted.isdisjoint(re.findall(r"[\w-]+", line["text"]))


def line_text(line: Line, names: Sequence[str], coloured: bool) -> str:
    """`HH:MM:SS.mmm node | text`, the name padded to the longest of `names`."""
    clock = time.strftime("%H:%M:%S", time.localtime(line["time"]))
    name = line["name"].ljust(max(map(len, names)))
    if coloured:
        colour = dict(zip(names, cycle(COLOURS), strict=False)).get(line["name"], 0)
        name = f"\x1b[{colour}m{name}\x1b[0m"
    return f"{clock}.{int(line['time'] % 1 * 1000):03d} {name} | {line['text']}"
