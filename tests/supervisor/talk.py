"""A program that runs for real, in a process of its own, and is followed by what it says."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

LINE = re.compile(r"^(\d\d:\d\d:\d\d\.\d{3}) (\S+) +\| (.*)$")


class Talk:
    """A program whose lines on standard error are heard as they come."""

    def __init__(self, command: list[str], environment: dict[str, str], cwd: Path) -> None:
        self.lines: list[tuple[str, str]] = []
        self.guard: int | None = None
        self._news = threading.Condition()
        self.process = subprocess.Popen(
            command,
            env=environment,
            cwd=cwd,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        self.listeners = [
            threading.Thread(target=self._hear, daemon=True),
            threading.Thread(target=self._hear_guard, daemon=True),
        ]
        for thread in self.listeners:
            thread.start()

    def _hear(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            match = LINE.match(line.rstrip("\n"))
            with self._news:
                self.lines.append((match[2], match[3]) if match else ("", line.rstrip("\n")))
                self._news.notify_all()

    def _hear_guard(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with contextlib.suppress(ValueError, TypeError, KeyError):
                self.guard = json.loads(line)["guard"]

    def said(self, name: str, pattern: str) -> list[re.Match[str]]:
        """Matches of a pattern at the start of what `name` said so far."""
        with self._news:
            lines = list(self.lines)
        found = (re.match(pattern, text) for who, text in lines if who == name)
        return [match for match in found if match]

    def wait(self, name: str, pattern: str, count: int = 1, timeout: float = 8.0) -> re.Match[str]:
        """The count-th time that `name` says something like `pattern`."""
        deadline = time.monotonic() + timeout
        while len(found := self.said(name, pattern)) < count:
            with self._news:
                left = deadline - time.monotonic()
                if left <= 0.0 or not self._news.wait(min(left, 0.2)):
                    assert left > 0.0, f"{name} never said {pattern!r}: {self.lines[-40:]}"
        return found[count - 1]

    def where(self, name: str, pattern: str) -> int:
        """Position of the first such line among all lines."""
        for i, (who, text) in enumerate(self.lines):
            if who == name and re.match(pattern, text):
                return i
        raise AssertionError(f"{name} never said {pattern!r}: {self.lines[-40:]}")

    def pid(self, name: str, start: int = 1) -> int:
        """Process id that a fake node printed at its n-th start."""
        return int(self.wait(name, r"start (\d+)", start)[1])

    def starts(self, name: str) -> int:
        return len(self.said(name, r"start \d+"))

    def signal(self, number: int) -> None:
        os.kill(self.process.pid, number)

    def end(self, timeout: float = 10.0) -> int:
        """Exit code, once all its words are heard."""
        code = self.process.wait(timeout)
        for thread in self.listeners:
            thread.join(2.0)
        return code

    def report(self) -> dict[str, dict[str, Any]]:
        """The last report of a fake supervisor that has ended, by process."""
        processes = json.loads(self.wait("lodeline", r"report (.*)")[1])
        return {process["process"]: process for process in processes}


Start = Callable[..., Talk]
"""`start((name, mode), (name, mode, plan options), seconds=..., **timing)`."""


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] not in "ZX"


def until(holds: Callable[[], bool], timeout: float) -> float:
    """Seconds until something holds; fails after `timeout` (times `patience`)."""
    began = time.monotonic()
    while not holds():
        assert time.monotonic() - began < timeout * patience(), "it never came true"
        time.sleep(0.002)
    return time.monotonic() - began


def patience() -> float:
    """How much longer than promised things may take: more than 1 only on a crowded machine."""
    crowd = os.getloadavg()[0] / (os.cpu_count() or 1)
    if crowd > 1.0:
        print(f"load is {crowd:.1f} per core: limits are stretched by that")
    return max(1.0, crowd)
