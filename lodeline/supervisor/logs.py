"""What nodes print, on its way to the terminal: prefixed, bounded, and never in anybody's way.

A node that floods loses lines, and is told how many; a terminal that stands still loses lines;
neither holds up the supervisor or a node.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from itertools import cycle

LINES_PER_S = 200.0
TAIL = 20
MAX_LINE = 8192
CHUNK = 1 << 16
PIPE_SIZE = 1 << 20
"""Room in the kernel for what nodes print while the supervisor is stopped."""
QUEUE = 4000

OURS = "lodeline"
BOLD = 1
COLOURS = (36, 32, 35, 34, 33, 96, 92, 95)
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[ -/]*[@-~]")
CONTROLS = {code: f"\\x{code:02x}" for code in (*range(9), *range(10, 32), *range(127, 160))}


class Console:
    """Writes lines in a thread of its own: `HH:MM:SS.mmm node | text`.

    `also(name, text)` gets each line too, and must not take long.
    """

    def __init__(
        self,
        descriptor: int,
        names: list[str],
        colour: bool,
        also: Callable[[str, str], None] = lambda _name, _text: None,
    ) -> None:
        # Bare writes: a daemon thread stuck in a buffered stream would hold up the exit.
        self._descriptor = descriptor
        self._also = also
        self._width = max(len(name) for name in (OURS, *names))
        self._colours: dict[str, int] = {}
        if colour:
            self._colours = dict(zip(names, cycle(COLOURS), strict=False)) | {OURS: BOLD}
        self._lines: deque[str] = deque()
        self._dropped = 0
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)
        self._thread.start()

    def line(self, name: str, text: str) -> None:
        """A line that a node printed."""
        self._also(name, text)
        now = time.time()
        clock = time.strftime("%H:%M:%S", time.localtime(now)) + f".{int(now % 1 * 1000):03d}"
        self._put(f"{clock} {self._painted(name)} | {text}")

    def event(self, text: str) -> None:
        """A line of the supervisor's own."""
        self.line(OURS, text)

    def close(self, timeout: float = 1.0) -> None:
        """Write what is left, at most for `timeout` seconds."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout)

    def _painted(self, name: str) -> str:
        padded = name.ljust(self._width)
        colour = self._colours.get(name)
        return padded if colour is None else f"\x1b[{colour}m{padded}\x1b[0m"

    def _put(self, line: str) -> None:
        with self._wake:
            if len(self._lines) < QUEUE:
                self._lines.append(line)
            else:
                self._dropped += 1
            self._wake.notify()

    def _run(self) -> None:
        while True:
            with self._wake:
                while not (self._lines or self._closing):
                    self._wake.wait()
                lines, dropped = list(self._lines), self._dropped
                self._lines.clear()
                self._dropped = 0
                last = self._closing
            if dropped:
                lines.append(f"LOG {dropped} lines dropped: the terminal does not keep up")
            # A terminal that is gone is no reason to stop the robot.
            with contextlib.suppress(OSError):
                self._write("".join(line + "\n" for line in lines).encode())
            if last:
                return

    def _write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._descriptor, data) :]


class LogPipe:
    """The supervisor's end of what one process prints. `emit(text)` gets each line kept."""

    def __init__(self, emit: Callable[[str], None], now: Callable[[], float]) -> None:
        self._emit = emit
        self._now = now
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.reader, False)
        with contextlib.suppress(OSError):  # this user's share of pipe memory is used up
            fcntl.fcntl(self.writer, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        self.tail: deque[str] = deque(maxlen=TAIL)
        self.ended = False
        self._rest = b""
        self._dropped = 0
        self._tokens = LINES_PER_S
        self._filled = now()

    def read(self) -> bool:
        """Take in what is there, at most one chunk; whether there was any."""
        try:
            data = os.read(self.reader, CHUNK)
        except OSError:
            return False
        self.ended = not data
        if data:
            self._take(data)
        return bool(data)

    def _take(self, data: bytes) -> None:
        self._refill()
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            lines.append(self._rest)
            self._rest = b""
        room = int(self._tokens)
        self._tokens -= min(room, len(lines))
        for line in lines[:room]:
            self._emit(self._keep(line))
        self._dropped += len(lines[room:])
        for line in lines[room:][-TAIL:]:
            self._keep(line)

    def drain(self) -> None:
        """The process is gone: take in all it left, even a line without an end."""
        for _ in range(2 * PIPE_SIZE // CHUNK):
            if not self.read():
                break
        if self._rest:
            self._emit(self._keep(self._rest))
            self._rest = b""
        self.report_dropped()

    def report_dropped(self) -> None:
        """Say how many lines were dropped since the last report, if any."""
        if self._dropped:
            self._emit(f"LOG {self._dropped} lines dropped: more than {LINES_PER_S:g} a second")
            self._dropped = 0

    def close(self) -> None:
        os.close(self.reader)

    def _refill(self) -> None:
        now = self._now()
        self._tokens = min(LINES_PER_S, self._tokens + (now - self._filled) * LINES_PER_S)
        self._filled = now

    def _keep(self, line: bytes) -> str:
        text = clean(line[:MAX_LINE].decode("utf-8", "replace"))
        self.tail.append(text)
        return text


def clean(text: str) -> str:
    """Text that cannot steer a terminal: colours removed, control characters spelt out."""
    return ESCAPES.sub("", text).rstrip("\r").translate(CONTROLS)
