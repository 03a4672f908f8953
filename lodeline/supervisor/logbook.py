"""What nodes printed, for those who look later or from elsewhere: `lodeline logs`, the page.

A line is a JSON object `{"n", "time", "name", "text"}`: its number, UNIX time [s], the process
that printed it, the text. The newest lines are kept for a query; new ones go out in batches, and
only while somebody listens. Nothing here ever holds up the supervisor.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

KEPT_BYTES = 256 << 10
"""All kept lines together, far below the longest message that the bus carries."""
LINE_BYTES = 100
"""What a line costs besides its text."""
BATCH_S = 0.1
FRESH_S = 2.0
CLOSE_S = 1.0


class Outlet(Protocol):
    """A way onto the bus."""

    watched: bool
    on_watched: Callable[[], None]

    def put(self, data: bytes) -> None: ...


class LogBook:
    """Keeps the newest lines; `add` may be called from any thread."""

    def __init__(self, now: Callable[[], float] = time.time) -> None:
        self._now = now
        self._lines: deque[dict[str, Any]] = deque()
        self._bytes = 0
        self._number = 0
        self._changed = threading.Condition()
        self._closed = False
        self._thread: threading.Thread | None = None

    def add(self, name: str, text: str) -> None:
        """Note a line that a process printed."""
        with self._changed:
            now = round(self._now(), 3)
            line = {"n": self._number, "time": now, "name": name, "text": text}
            self._number += 1
            self._lines.append(line)
            self._bytes += _size(line)
            while self._bytes > KEPT_BYTES:
                self._bytes -= _size(self._lines.popleft())
            self._changed.notify()

    def kept(self) -> bytes:
        """All kept lines as a JSON list."""
        with self._changed:
            lines = list(self._lines)
        return _packed(lines)

    def publish(self, outlet: Outlet) -> None:
        """From now on put new lines, as JSON lists, whenever there is somebody who listens."""
        outlet.on_watched = self._wake
        self._thread = threading.Thread(target=self._run, args=(outlet,), name="log", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Put what is left; nothing goes out any more after this."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join(CLOSE_S)

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify()

    def _run(self, outlet: Outlet) -> None:
        sent = 0
        while True:
            with self._changed:
                while not (self._closed or (outlet.watched and self._number > sent)):
                    self._changed.wait()
                last = self._closed
                # Who has just begun to listen asks for what is older.
                oldest = self._now() - FRESH_S
                lines = [x for x in self._lines if x["n"] >= sent and x["time"] >= oldest]
                sent = self._number
            if lines and outlet.watched:
                outlet.put(_packed(lines))
            if last:
                return
            time.sleep(BATCH_S)


def _size(line: dict[str, Any]) -> int:
    return LINE_BYTES + len(line["text"].encode())


def _packed(lines: list[dict[str, Any]]) -> bytes:
    return json.dumps(lines, ensure_ascii=False).encode()
