"""A pipeline that a bench runs for itself, in a run folder of its own, and listens to."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lodeline.run_folder import running
from lodeline.sessions import Client
from lodeline.watch import Watch
from lodeline_msgs import NodeStatus, Odometry, PoseEstimate, unpack

START_S = 60.0
STOP_S = 20.0


class Rig:
    """`with Rig(file) as rig:` a pipeline that is up; its log, processes, poses and truth.

    Times in `log`, `poses`, `truths` and `gaps` are those of arrival [s], monotonic; `gaps` are
    those that odometry announced. One that is `deaf` hears no samples, so that none is sent for its
    sake.
    """

    def __init__(self, file: str, *settings: str, deaf: bool = False) -> None:
        self._deaf = deaf
        self._folder = tempfile.TemporaryDirectory(prefix="llb", ignore_cleanup_errors=True)
        self.log: list[tuple[float, str]] = []
        self.poses: list[tuple[float, PoseEstimate]] = []
        self.truths: list[tuple[float, Odometry]] = []
        self.gaps: list[float] = []
        self._resets: int | None = None
        self.counts: dict[str, int] = {}
        self.environment = {**os.environ, "LODELINE_RUN": self._folder.name, "NO_COLOR": "1"}
        words = [word for setting in settings for word in ("--set", setting)]
        self.supervisor = subprocess.Popen(
            [sys.executable, "-P", "-m", "lodeline", "up", file, *words],
            env=self.environment,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        if not self.until(lambda: self.says("up in ") or self.ended, START_S) or self.ended:
            lines = "\n".join(text for _, text in self.log)
            self._end()
            raise RuntimeError(f"the pipeline did not come up:\n{lines}")
        (self.running,) = running(base=Path(self._folder.name))
        self.name = self.running.manifest.name
        self.client = Client(self.running.folder)
        self.watch = Watch(self.running)
        if not self._deaf:
            self.client.subscribe(f"{self.name}/**", 4096, self._take)
        return self

    @property
    def ended(self) -> bool:
        """Whether the supervisor is gone."""
        return self.supervisor.poll() is not None

    def says(self, text: str, since: float = 0.0) -> bool:
        """Whether a line of the log from then on holds the text."""
        return any(text in line for when, line in list(self.log) if when >= since)

    def until(self, what: Callable[[], bool], seconds: float) -> bool:
        """Whether something comes true in time."""
        end = time.monotonic() + seconds
        while not what():
            if time.monotonic() > end:
                return False
            time.sleep(0.005)
        return True

    def count(self, key: str) -> int:
        """Samples heard on a key."""
        return self.counts.get(f"{self.name}/{key}", 0)

    def processes(self) -> dict[str, dict[str, Any]]:
        """What the supervisor says of each node's process."""
        return self.watch.processes()

    def statuses(self) -> dict[str, NodeStatus]:
        """What each node says of itself."""
        return self.watch.statuses(5.0)

    def _read(self) -> None:
        assert self.supervisor.stderr is not None
        for line in self.supervisor.stderr:
            self.log.append((time.monotonic(), line.rstrip("\n")))

    def _take(self, key: str, data: bytes, _encoding: str) -> None:
        self.counts[key] = self.counts.get(key, 0) + 1
        if key == f"{self.name}/pose":
            self.poses.append((time.monotonic(), unpack(data, PoseEstimate)))
        elif key == f"{self.name}/truth":
            self.truths.append((time.monotonic(), unpack(data, Odometry)))
        elif key == f"{self.name}/odom":
            resets = unpack(data, Odometry).resets
            if self._resets not in (None, resets):
                self.gaps.append(time.monotonic())
            self._resets = resets

    def _end(self) -> None:
        if not self.ended:
            self.supervisor.send_signal(signal.SIGCONT)
            self.supervisor.send_signal(signal.SIGTERM)
            try:
                self.supervisor.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self.supervisor.kill()
                self.supervisor.wait()
        self._reader.join(STOP_S)
        self._folder.cleanup()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.watch.__exit__(kind, error, trace)
        self.client.close()
        self._end()


def position_errors(
    poses: list[tuple[float, PoseEstimate]], truths: list[tuple[float, Odometry]]
) -> list[tuple[float, float]]:
    """(time of arrival [s], distance from the truth at its stamp [m]) of each pose."""
    found, place = [], 0
    for when, pose in poses:
        while place + 2 < len(truths) and truths[place + 1][1].stamp < pose.stamp:
            place += 1
        if place + 1 >= len(truths):
            break
        a, b = truths[place][1], truths[place + 1][1]
        if not a.stamp <= pose.stamp <= b.stamp or b.stamp - a.stamp > 200_000_000:
            continue  # the truth itself was away
        part = (pose.stamp - a.stamp) / (b.stamp - a.stamp)
        x, y = a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)
        found.append((when, ((pose.x - x) ** 2 + (pose.y - y) ** 2) ** 0.5))
    return found
