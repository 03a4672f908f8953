"""Counts of a Beego's two motors, read as lines of text. Yours to change.

A Beego's motors hang on a controller of their own, and a program talks to it (YP-Spur, or the one
that wrote the lecture's files). This driver reads what such a program says of the encoders: a line
for each of its samples, as in the lecture's files,

    time [s]   counter 1   counter 2   (more columns are left alone)

where a counter is what its motor counted since the line before. `port` is where the lines come
from: a serial line (/dev/ttyACM0), or a pipe that the program writes into:
`mkfifo motors; ./your_program > motors`. If yours says it otherwise, `counted` is what to change.
"""

from __future__ import annotations

import errno
import os
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline.stamps import seconds
from lodeline_msgs import WheelTicks

SILENT_AFTER = 0.5  # s without a line
RETRY = 0.5  # s between two tries to open the port
RIGHTS = "sudo usermod -aG dialout $USER, then log out and in"


@dataclass(frozen=True, slots=True)
class CountersParams:
    """Where the lines come from, and how often we look for some."""

    port: Annotated[str, "device or pipe; sim: what motors.py writes"] = "sim"
    rate: Annotated[float, "Hz"] = 100.0


class Counters(Driver[CountersParams]):
    """Adds up what the lines say. Whenever it cannot tell what was missed, it counts from 0."""

    wheels = Output(WheelTicks)

    def setup(self) -> None:
        port = self.params.port
        self.path = self.context.run_folder / "motors" if port == "sim" else Path(port)
        self.fd: int | None = None
        self.is_terminal = False
        self.rest = b""  # of a line whose end has not come yet
        self.counting = False
        self.left = self.right = 0
        self.heard_s = self.retry_s = float("-inf")

    def close(self) -> None:
        if self.fd is not None:
            os.close(self.fd)
        self.fd = None

    def tick(self, stamp: int) -> None:
        """Called `rate` times a second; `stamp` is now [ns]."""
        now_s = seconds(stamp)
        ways = [way for line in self.lines(now_s) if (way := self.counted(line)) is not None]
        if ways:
            self.heard_s = now_s
            self.count(ways)
            self.wheels.send(WheelTicks(stamp, self.left, self.right))
        elif self.fd is not None and now_s - self.heard_s > SILENT_AFTER:
            text = f"no line for {SILENT_AFTER:g} s - does the program run that writes them?"
            self.fail(f"COUNTERS_SILENT {self.path}: {text}")

    def count(self, ways: list[tuple[int, int]]) -> None:
        """Add up; what came before the first line, or in a silence, nobody knows."""
        if not self.counting:
            self.left = self.right = 0  # tells the odometry that this is a new beginning
            self.counting = True
            back = self.context.state == "fault"
            self.context.report("running", f"COUNTERS_BACK {self.path}" if back else "")
            return
        self.left += sum(left for left, _ in ways)
        self.right += sum(right for _, right in ways)

    def counted(self, line: str) -> tuple[int, int] | None:
        """What a line says that (left, right) counted, None if it says nothing."""
        if not line.strip() or line.lstrip().startswith("#"):
            return None
        try:
            _, left, right, *_ = line.replace(",", " ").split()
            return int(left), int(right)
        except ValueError:
            self.context.reject("bad line")
            return None

    def lines(self, now_s: float) -> list[str]:
        """All lines that have come in whole since the last look."""
        if self.fd is None and not self.open(now_s):
            return []
        assert self.fd is not None
        try:
            got = os.read(self.fd, 4096)
            if not got and self.is_terminal:  # hung up; an empty pipe only waits for its writer
                raise OSError(errno.EIO, os.strerror(errno.EIO))
        except BlockingIOError:  # nothing yet
            return []
        except OSError as error:
            self.close()
            self.fail(f"COUNTERS_GONE {self.path}: {error.strerror} - check its plug")
            return []
        *whole, self.rest = (self.rest + got).split(b"\n")
        return [line.decode(errors="replace") for line in whole]

    def open(self, now_s: float) -> bool:
        """Open the port, if it is there; not more often than twice a second."""
        if now_s - self.retry_s < RETRY:
            return False
        self.retry_s = now_s
        try:
            self.fd = os.open(self.path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
            self.is_terminal = os.isatty(self.fd)
            if self.is_terminal:
                tty.setraw(self.fd)  # a USB port needs no speed; else: stty -F PORT 115200
        except OSError as error:
            fix = RIGHTS if isinstance(error, PermissionError) else "is it plugged in?"
            self.fail(f"COUNTERS_GONE {self.path}: {error.strerror} - {fix}")
            return False
        self.rest = b""
        self.heard_s = now_s
        return True

    def fail(self, text: str) -> None:
        """Say what is wrong; nothing is sent until a line comes again."""
        self.counting = False
        self.context.report("fault", text)


if __name__ == "__main__":
    from lodeline.process import run

    run(Counters)
