"""What a node process is told from outside while it runs."""

from __future__ import annotations

import os
import select
import signal
from typing import Any


class Orders:
    """What the outside wants: `go` on a line of standard input; `stop` at its end or by signal.

    `epoch N` gives the time of another host to go by: `epoch` [ns] is UNIX time there less
    monotonic time here, None while there is nothing new.
    """

    def __init__(self) -> None:
        self.go = False
        self.stop = False
        self.epoch: int | None = None
        self._rest = b""
        self._wake, write = os.pipe()
        os.set_blocking(write, False)
        signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._stopped)

    def _stopped(self, _number: int, _frame: Any) -> None:
        self.stop = True

    def wait(self, seconds: float) -> None:
        """Until an order comes or the time is over."""
        ready, _, _ = select.select([0, self._wake], [], [], seconds)
        if self._wake in ready:
            os.read(self._wake, 64)
        if 0 in ready:
            text = os.read(0, 64)
            self.stop = self.stop or not text
            *lines, self._rest = (self._rest + text).split(b"\n")
            for line in lines:
                word, _, value = line.partition(b" ")
                if word == b"go":
                    self.go = True
                elif word == b"epoch":
                    self.epoch = int(value)
