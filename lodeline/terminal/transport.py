"""Play and pause from the keyboard, and a bar that shows how far it has gone."""

from __future__ import annotations

import os
import select
import sys
import termios
import time
import tty
from typing import Any, Self

BAR = 30
SHOW_S = 0.2


class Transport:
    """`with Transport(first, last) as transport`: `look` for `play`, over log times [ns].

    The keyboard is read and the bar shown only on a terminal.
    """

    def __init__(self, first: int, last: int) -> None:
        self._first = first
        self._length = max(1, last - first)
        self._keyboard = sys.stdin.fileno() if sys.stdin and sys.stdin.isatty() else None
        self._shown: float | None = 0.0 if sys.stderr.isatty() else None
        self._settings: list[Any] = []

    def look(self, log_time: int) -> float:
        """Show the place; hold while it is paused. Seconds that it held."""
        now = time.monotonic()
        if self._shown is not None and now - self._shown > SHOW_S:
            self._shown = now
            self._show(log_time, "space: pause")
        if not self._space(0.0):
            return 0.0
        self._show(log_time, "paused      ")
        while not self._space(None):
            pass
        return time.monotonic() - now

    def _space(self, timeout: float | None) -> bool:
        if self._keyboard is None or not select.select([self._keyboard], [], [], timeout)[0]:
            return False
        data = os.read(self._keyboard, 1)
        if not data:  # the terminal is gone: play on
            self._keyboard = None
        return data in (b" ", b"")

    def _show(self, log_time: int, state: str) -> None:
        if self._shown is None:
            return
        part = min(1.0, (log_time - self._first) / self._length)
        bar = "#" * int(BAR * part)
        seconds = f"{(log_time - self._first) * 1e-9:.1f} / {self._length * 1e-9:.1f} s"
        sys.stderr.write(f"\r[{bar:.<{BAR}}] {seconds}  {state}\x1b[K")
        sys.stderr.flush()

    def __enter__(self) -> Self:
        if self._keyboard is not None:
            self._settings = termios.tcgetattr(self._keyboard)
            tty.setcbreak(self._keyboard)
        return self

    def __exit__(self, *_: object) -> None:
        if self._settings:
            termios.tcsetattr(sys.stdin.fileno(), termios.TCSADRAIN, self._settings)
        if self._shown is not None:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
