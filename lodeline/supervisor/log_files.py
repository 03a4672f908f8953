"""What nodes printed, on disk: outlives the run, and never grows beyond its bounds.

One file for each process, `NODE.log`, and `lodeline.log` for the supervisor itself. One that is
full becomes `NODE.log.1`, and so on; the oldest of five goes. At 5 MB each, a node that never
stops talking takes 25 MB. A line is `2026-11-24 05:31:42.123 text`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

FILE_BYTES, FILES = 5_000_000, 5
QUEUE = 4000
BATCH_S = 0.2
CLOCK = "%Y-%m-%d %H:%M:%S"
CLOCK_WIDTH = len("2026-11-24 05:31:42.123")


class LogFiles:
    """Writes lines in a thread of its own: a disk that is slow or full costs lines, not time.

    `report(text)` is told once when the files cannot be written.
    """

    def __init__(self, folder: Path, report: Callable[[str], None]) -> None:
        self._folder = folder
        self._report = report
        self._lines: deque[tuple[float, str, str]] = deque(maxlen=QUEUE)
        self._wake = threading.Condition()
        self._closed = False
        self._broken = False
        self._thread = threading.Thread(target=self._run, name="log files", daemon=True)
        self._thread.start()

    def add(self, name: str, text: str) -> None:
        """A line that a process printed; from any thread."""
        with self._wake:
            self._lines.append((time.time(), name, text))
            self._wake.notify()

    def close(self, timeout: float = 1.0) -> None:
        """Write what is left, at most for `timeout` seconds."""
        with self._wake:
            self._closed = True
            self._wake.notify()
        self._thread.join(timeout)

    def _run(self) -> None:
        last = False
        while not last:
            with self._wake:
                while not (self._lines or self._closed):
                    self._wake.wait()
                lines, last = list(self._lines), self._closed
                self._lines.clear()
            try:
                self._write(lines)
                self._broken = False
            except OSError as error:
                if not self._broken:
                    self._broken = True
                    self._report(
                        f"LOG_FILES {self._folder}: {error.strerror}: lines are lost there"
                    )
            if not last:
                time.sleep(BATCH_S)

    def _write(self, lines: list[tuple[float, str, str]]) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        texts: dict[str, list[bytes]] = {}
        for when, name, text in lines:
            clock = time.strftime(CLOCK, time.localtime(when)) + f".{int(when % 1 * 1000):03d}"
            texts.setdefault(name, []).append(f"{clock} {text}\n".encode())
        for name, parts in texts.items():
            append(self._folder / f"{name}.log", parts)


def append(file: Path, lines: list[bytes]) -> None:
    """Add lines to a file, which is put aside whenever it is full."""
    size = file.stat().st_size if file.exists() else 0
    waiting: list[bytes] = []
    for line in lines:
        if size + len(line) > FILE_BYTES:
            _add(file, waiting)
            _turn(file)
            waiting, size = [], 0
        waiting.append(line)
        size += len(line)
    _add(file, waiting)


def _add(file: Path, lines: list[bytes]) -> None:
    with file.open("ab") as stream:
        stream.write(b"".join(lines))


def _turn(file: Path) -> None:
    """Rename FILE to FILE.1, FILE.1 to FILE.2, and so on."""
    for number in range(FILES - 1, 0, -1):
        older = file.with_name(f"{file.name}.{number}")
        newer = file if number == 1 else file.with_name(f"{file.name}.{number - 1}")
        if newer.exists():
            newer.replace(older)


def read(folder: Path) -> Iterator[dict[str, Any]]:
    """Lines of all processes in the order of time, from the newest file of each."""
    lines = [line for file in sorted(folder.glob("*.log")) for line in _read(file)]
    yield from sorted(lines, key=lambda line: float(line["time"]))


def _read(file: Path) -> Iterator[dict[str, Any]]:
    with file.open(encoding="utf-8", errors="replace") as stream:
        for line in stream:
            try:
                when = datetime.strptime(line[:CLOCK_WIDTH], f"{CLOCK}.%f").timestamp()
            except ValueError:
                continue  # the disk was full in the middle of it
            yield {"time": when, "name": file.stem, "text": line[CLOCK_WIDTH + 1 :].rstrip("\n")}
