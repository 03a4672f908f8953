"""Claims about a wall clock that is stepped under a running pipeline: nothing bends."""

from __future__ import annotations

import os
import shutil
import signal
import struct
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from lodeline.sessions import Client
from lodeline.watch import Watch
from lodeline_msgs import WheelTicks, unpack
from tests.support.live import Up, eventually

HERE = Path(__file__).parent
COMPILER = shutil.which("cc") or shutil.which("gcc")
SECOND = 1_000_000_000
PIPELINE = f"""
name: stepped
nodes:
  source: {{run: {HERE}/nodes/wheels.py, outputs: {{wheels: wheels}}, rate: {{wheels: 100}}}}
  relay: {{run: {HERE}/nodes/relay.py, inputs: {{wheels: wheels}}, outputs: {{back: back}}}}
"""
# Nodes get no LD_PRELOAD from their supervisor, so each python here sees to it itself.
SITE = """
import os, sys
if os.environ.get("LD_PRELOAD") != {shim!r}:
    os.environ["LD_PRELOAD"] = {shim!r}
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
"""


class WallClock:
    """The wall clock of everything that is started in the environment of this test."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        assert COMPILER is not None
        shim, self._file = folder / "skewclock.so", folder / "skew"
        flags = ["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o", str(shim)]
        subprocess.run([COMPILER, *flags, str(HERE / "skewclock.c"), "-ldl"], check=True)
        (folder / "sitecustomize.py").write_text(SITE.format(shim=str(shim)))
        self._file.write_bytes(struct.pack("l", 0))
        monkeypatch.setenv("LODELINE_TEST_SKEW", str(self._file))
        monkeypatch.setenv("PYTHONPATH", str(folder))

    def step(self, seconds: int) -> None:
        """Put the wall clock so far off the true time."""
        with self._file.open("r+b") as file:
            file.write(struct.pack("l", seconds))

    def seen_by(self, command: list[str]) -> int:
        """What `date` or the like, started now, says [s]."""
        return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def has_more_than(back: list[WheelTicks], count: int) -> bool:
    return back[-1].left > count


@pytest.mark.skipif(COMPILER is None, reason="no C compiler for the shim")
def test_ten_minutes_forth_and_back_bend_no_stamp_and_make_no_sample_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = WallClock(tmp_path, monkeypatch)
    file = tmp_path / "stepped.yaml"
    file.write_text(PIPELINE)
    python = [sys.executable, "-c", "import time; print(round(time.time()))"]
    with Up(file) as up, Watch(up.running) as watch:
        back: list[WheelTicks] = []
        client = Client(up.folder)
        client.subscribe(
            "stepped/back", 4096, lambda _k, data, _e: back.append(unpack(data, WheelTicks))
        )
        assert eventually(lambda: len(back) > 100)
        true = clock.seen_by(python)
        for seconds, step in ((600, "+600"), (-600, "-1200")):
            clock.step(seconds)
            assert clock.seen_by(python) == pytest.approx(true + seconds, abs=30.0)
            assert eventually(partial(up.says, f"CLOCK_STEP {step} s"))
            newest = back[-1].left
            assert eventually(partial(has_more_than, back, newest + 200))
        os.kill(up.ps()["source"]["pid"], signal.SIGKILL)  # its successor starts in stepped time
        assert eventually(lambda: back[-1].left < 100)
        assert eventually(lambda: back[-1].left > 200)
        status = watch.statuses(2.0)["relay"]
        client.close()
    assert sum(status.late.values()) == 0
    assert not status.rejected
    assert status.age_p99
    assert all(0.0 < age < 0.5 for age in status.age_p99.values())
    steps = [(b.stamp - a.stamp) / SECOND for a, b in pairwise(back)]
    assert min(steps) > 0.0
    assert max(steps) < 10.0, "no step of the wall clock, at most the time of a restart"
