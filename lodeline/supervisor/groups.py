"""The supervisor's line to its guard: which process groups are to die with it."""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from lodeline.supervisor import guard

GUARD = Path(__file__).with_name("guard.sh")
RETRY_S = 1.0
GOODBYE_S = 0.5


class Groups:
    """Process groups of a run. The guard that knows them is started again when it dies."""

    def __init__(
        self, marks: Sequence[str], environment: Mapping[str, str], event: Callable[[str], None]
    ) -> None:
        self._marks = marks
        self._environment = dict(environment)
        self._event = event
        self._groups: set[int] = set()
        self._guard: subprocess.Popen[bytes] | None = None
        self._pidfd = -1
        self._started = 0.0
        self._closed = False

    @property
    def guard_pid(self) -> int | None:
        """Process id of the guard, None while there is none."""
        return None if self._guard is None else self._guard.pid

    def start(self) -> None:
        """Start a guard and tell it all groups."""
        if self._closed:
            return
        sweep = [sys.executable, "-I", "-S", guard.__file__, *self._marks]
        self._guard = subprocess.Popen(
            ["/bin/sh", GUARD, *sweep],
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            env=self._environment,
            start_new_session=True,  # Ctrl-C and our own group kills must not reach it
        )
        assert self._guard.stdin is not None
        os.set_blocking(self._guard.stdin.fileno(), False)
        self._started = time.monotonic()
        self._pidfd = os.pidfd_open(self._guard.pid)
        asyncio.get_running_loop().add_reader(self._pidfd, self._died)
        for group in self._groups:
            self._tell(f"+{group}\n")

    def add(self, group: int) -> None:
        """This group is to die with us."""
        self._groups.add(group)
        self._tell(f"+{group}\n")

    def discard(self, group: int) -> None:
        """This group is gone; its number may soon be another's."""
        self._groups.discard(group)
        self._tell(f"-{group}\n")

    def close(self) -> None:
        """Dismiss the guard, which looks once more for what is left."""
        self._closed = True
        if self._guard is None:
            return
        asyncio.get_running_loop().remove_reader(self._pidfd)
        os.close(self._pidfd)
        assert self._guard.stdin is not None
        self._guard.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._guard.wait(GOODBYE_S)

    def _tell(self, line: str) -> None:
        if self._guard is not None and self._guard.stdin is not None:
            with contextlib.suppress(OSError):  # it just died: its successor is told all
                os.write(self._guard.stdin.fileno(), line.encode())

    def _died(self) -> None:
        assert self._guard is not None and self._guard.stdin is not None
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._pidfd)
        os.close(self._pidfd)
        self._guard.stdin.close()
        code = self._guard.wait()
        self._guard = None
        self._event(f"GUARD_EXIT {code}: started again")
        soon = time.monotonic() - self._started < RETRY_S
        loop.call_later(RETRY_S if soon else 0.0, self.start)
