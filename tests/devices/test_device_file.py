"""The drivers, and Debian's i2c-tools, on a device file: /dev/i2c-9 that leads to the simulator.

A shim in C answers the ioctls here, and shares nothing with the stand-in that other tests use.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from math import sqrt
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from lodeline.sim.params import RobotParams
from lodeline.sim.robot import SimulatedRobot
from lodeline.sim.server import I2cServer
from tests.support.live import eventually

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
COMPILER = shutil.which("cc") or shutil.which("gcc")
Run = Callable[..., subprocess.CompletedProcess[str]]

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler for the shim")


@pytest.fixture(scope="module")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shim, compiled."""
    assert COMPILER is not None
    library = tmp_path_factory.mktemp("shim") / "i2c_shim.so"
    flags = ["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o", str(library)]
    subprocess.run([COMPILER, *flags, str(HERE / "i2c_shim.c"), "-ldl"], check=True)
    return library


@pytest.fixture(scope="module")
def robot(shim: Path) -> Iterator[SimulatedRobot]:
    """A robot on its course, in real time, behind the socket beside the shim."""
    robot = SimulatedRobot(RobotParams(standing=0.0), time.monotonic)
    with I2cServer(robot.bus, shim.with_name("i2c.sock")):
        yield robot


@pytest.fixture(scope="module")
def run(shim: Path, robot: SimulatedRobot) -> Run:
    """Run a program that sees the device file."""

    def call(*command: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {
            "LD_PRELOAD": str(shim),
            "I2C_SHIM_DEVICE": "/dev/i2c-9",
            "I2C_SHIM_SOCKET": str(shim.with_name("i2c.sock")),
            "PYTHONPATH": f"{ROOT}:{ROOT / 'proto'}",
            "PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin",
        }
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=30, check=False
        )

    return call


def tool(name: str) -> str:
    """A program of i2c-tools; the test is skipped without it."""
    found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
    if found is None:
        pytest.skip(f"no {name} here: apt install i2c-tools")
    return found


def grid(text: str) -> dict[int, str]:
    """The cells of i2cdetect's table that answer."""
    cells = {}
    for line in text.splitlines()[1:]:
        row, _, rest = line.partition(":")
        for column in range(16):
            cell = rest[1 + 3 * column : 3 + 3 * column].strip()
            if cell not in ("", "--"):
                cells[int(row, 16) + column] = cell
    return cells


def test_i2cdetect_sees_the_robot_s_devices(run: Run, robot: SimulatedRobot) -> None:
    robot.imu.reset()  # the bypass is off
    result = run(tool("i2cdetect"), "-y", "9")
    assert result.returncode == 0, result.stderr
    assert grid(result.stdout) == {0x20: "20", 0x40: "40", 0x41: "41", 0x68: "68"}


def test_i2cset_switches_the_bypass_and_the_magnetometer_comes_up(run: Run) -> None:
    i2cget, i2cset = tool("i2cget"), tool("i2cset")
    assert run(i2cget, "-y", "9", "0x68", "0x75").stdout.strip() == "0x71"
    assert run(i2cget, "-y", "9", "0x0c", "0x00").returncode != 0
    assert run(i2cset, "-y", "9", "0x68", "0x37", "0x02").returncode == 0
    assert run(i2cget, "-y", "9", "0x0c", "0x00").stdout.strip() == "0x48"
    assert 0x0C in grid(run(tool("i2cdetect"), "-y", "9").stdout)


def test_words_and_blocks_go_both_ways(run: Run, robot: SimulatedRobot) -> None:
    i2cget, i2cset = tool("i2cget"), tool("i2cset")
    assert run(i2cset, "-y", "9", "0x68", "0x19", "0x0305", "w").returncode == 0
    assert run(i2cget, "-y", "9", "0x68", "0x19", "w").stdout.strip() == "0x0305"
    assert (robot.imu._registers[0x19], robot.imu._registers[0x1A]) == (5, 3)
    block = ["0x04", "0x02", "0x08", "0x10", "i"]
    assert run(i2cset, "-y", "9", "0x68", "0x19", *block).returncode == 0
    assert run(i2cget, "-y", "9", "0x68", "0x19", "i", "4").stdout.split() == block[:4]


def test_i2ctransfer_reads_gravity_in_one_burst(run: Run, robot: SimulatedRobot) -> None:
    robot.imu.reset()
    i2cget = tool("i2cget")
    status = ("-y", "9", "0x68", "0x3a")
    assert eventually(lambda: int(run(i2cget, *status).stdout, 16) & 1 == 1), "it has measured"
    result = run(tool("i2ctransfer"), "-y", "9", "w1@0x68", "0x3b", "r6")
    raw = bytes(int(word, 16) for word in result.stdout.split())
    force = [int.from_bytes(raw[i : i + 2], "big", signed=True) / 16384.0 for i in (0, 2, 4)]
    assert sqrt(sum(axis * axis for axis in force)) == pytest.approx(1.0, abs=0.15)


def read_all(run: Run, *arguments: str) -> dict[str, Any]:
    result = run(sys.executable, str(HERE / "through_the_shim.py"), *arguments)
    assert result.returncode == 0, result.stderr
    said: dict[str, Any] = json.loads(result.stdout)
    return said


def test_the_drivers_find_on_a_device_file_what_they_find_in_the_simulator(run: Run) -> None:
    said = read_all(run)
    assert said["health"] == ["ok", "ok", "ok"], said["messages"]
    norms = [sqrt(sum(axis * axis for axis in force)) for _, force in said["samples"]]
    assert len(norms) > 60
    assert sum(norms) / len(norms) == pytest.approx(9.81, abs=0.1)
    assert len(said["fields"]) > 30
    left = [count[0] for count in said["counts"]]
    assert left[-1] - left[0] > 5000, "0.12 m/s for 1.5 s"
    assert all(after >= before for before, after in pairwise(left))
    assert len(said["reeds"]) > 60


def test_the_fifo_is_read_through_a_device_file_with_steady_stamps(run: Run) -> None:
    said = read_all(run, "fifo")
    assert said["health"][0] == "ok", said["messages"]
    stamps = [stamp for stamp, _ in said["samples"]]
    assert len(stamps) > 700
    steps = [1e-6 * (after - before) for before, after in pairwise(stamps)]
    assert min(steps) > 0.0
    assert 1000.0 / median(steps) == pytest.approx(1003.0, rel=0.02), "a busy machine loses some"


def test_the_doctor_is_content_with_the_device_file(run: Run) -> None:
    result = run(sys.executable, "-m", "lodeline", "doctor", "bus", "--bus", "9", "--json")
    said = json.loads(result.stdout)
    verdicts = {check["name"]: check["verdict"] for check in said["checks"]}
    assert result.returncode == 0, said
    assert verdicts["device file"] == verdicts["rights"] == verdicts["scan"] == "ok"


def test_without_a_simulator_the_device_cannot_be_opened(run: Run, shim: Path) -> None:
    result = run(
        "env", "I2C_SHIM_SOCKET=/nonexistent", sys.executable, str(HERE / "through_the_shim.py")
    )
    assert result.returncode == 1
    assert "OSError" in result.stderr
