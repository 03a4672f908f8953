"""Running pipelines for tests: `lodeline up` as a user starts it, in a run folder of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

from lodeline.run_folder import Running, running

ROOT = Path(__file__).parents[2]


def eventually(what: Callable[[], bool], seconds: float = 10.0, step: float = 0.02) -> bool:
    """Whether a condition comes true within the time, looked at again and again."""
    deadline = time.monotonic() + seconds
    while not what():
        if time.monotonic() > deadline:
            return False
        time.sleep(step)
    return True


def environment(run: Path, **more: str) -> dict[str, str]:
    """The environment of a command whose pipelines live in the folder `run`."""
    return {**os.environ, "LODELINE_RUN": str(run), "NO_COLOR": "1", **more}


def lodeline(*arguments: str, run: Path, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        [sys.executable, "-P", "-m", "lodeline", *arguments],
        env=environment(run),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def living(marker: str) -> list[int]:
    """Pids of processes, zombies aside, whose environment holds a text."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            marked = marker.encode() in (entry / "environ").read_bytes()
            state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if marked and state != "Z":
            found.append(int(entry.name))
    return found


class Up:
    """`with Up(file) as up:` a pipeline that runs and whose sources have been released.

    `folder` is its run folder, `run` the base for other commands.
    """

    def __init__(self, file: Path | str, *arguments: str, base: Path | None = None) -> None:
        # Not pytest's tmp_path: its name may be too long for the path of a socket.
        self._temporary = tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True)
        self.run = base or Path(self._temporary.name)
        self._command = [sys.executable, "-P", "-m", "lodeline", "up", str(file), *arguments]
        self.log: list[str] = []

    def __enter__(self) -> Self:
        self.process = subprocess.Popen(
            self._command, env=environment(self.run), stderr=subprocess.PIPE, text=True
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        ready = eventually(lambda: self.says("up in ") or self.process.poll() is not None, 30.0)
        if not ready or self.process.poll() is not None:
            self.__exit__(None, None, None)
            raise AssertionError("the pipeline did not come up:\n" + "".join(self.log))
        return self

    def _read(self) -> None:
        assert self.process.stderr is not None
        self.log.extend(self.process.stderr)

    def says(self, text: str) -> bool:
        """Whether some line of the log holds the text."""
        return any(text in line for line in list(self.log))

    @property
    def running(self) -> Running:
        """The one pipeline that runs here, as tools find it."""
        (found,) = running(base=self.run)
        return found

    @property
    def folder(self) -> Path:
        """Its run folder."""
        return self.running.folder

    def call(self, *arguments: str, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
        """Another command beside the running pipeline."""
        return lodeline(*arguments, run=self.run, timeout=timeout)

    def ps(self) -> dict[str, dict[str, Any]]:
        """What `lodeline ps --json` says of each process."""
        result = self.call("ps", "--json")
        assert result.returncode == 0, result.stderr
        return {
            process["process"]: process
            for report in json.loads(result.stdout)
            for process in report["processes"]
        }

    def stop(self, number: int = signal.SIGINT, seconds: float = 15.0) -> int:
        """Send a signal to the supervisor and wait for its end; the exit code."""
        self.process.send_signal(number)
        return self.process.wait(seconds)

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.stop()
        self._reader.join(5.0)
        self._temporary.cleanup()
