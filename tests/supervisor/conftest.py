"""Supervisors that run for real, over fake nodes."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lodeline.supervisor.guard import kill_marked
from tests.supervisor.talk import Start, Talk

HERE = Path(__file__).parent


@pytest.fixture
def run_base() -> Iterator[Path]:
    """A base of run folders that is short enough for sockets; nothing of it outlives the test."""
    base = Path(tempfile.mkdtemp(prefix="ll-"))
    yield base
    kill_marked(f"NOTIFY_SOCKET={base}/")
    shutil.rmtree(base, ignore_errors=True)


@pytest.fixture
def supervise(run_base: Path) -> Iterator[Start]:
    """`supervise(("a", "good"), ("b", "crash", {"restart": "never"}), seconds=1, link=0.2)`."""
    started: list[Talk] = []

    def start(*nodes: tuple[Any, ...], seconds: float | None = None, **timing: Any) -> Talk:
        full = [(*node, {}) if len(node) == 2 else node for node in nodes]
        order = json.dumps({"nodes": full, "seconds": seconds, "timing": timing})
        environment = os.environ | {"LODELINE_RUN": str(run_base), "SECRET_TOKEN": "seen"}
        command = [sys.executable, "-P", str(HERE / "fake_up.py"), order]
        started.append(Talk(command, environment, run_base))
        return started[-1]

    yield start
    for talk in started:
        with contextlib.suppress(ProcessLookupError):
            talk.process.send_signal(signal.SIGKILL)
        talk.end()
