"""Claims about `lodeline calibrate` beside a pipeline that runs: it asks, finds, hands over."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import threading
import time
from math import hypot
from pathlib import Path
from typing import Any

import pytest

from lodeline.calibration import ImuCalibration
from lodeline.calibration_file import calibrated, load
from lodeline.sessions import Client
from lodeline.sim.chips.mpu import GRAVITY
from lodeline_msgs import Odometry, Twist, encoding_of, pack, unpack
from tests.calibrate_verb.turned_board import OFFSET, SCALE
from tests.support.live import ROOT, Up, environment, eventually

PIPELINE = f"""
name: bench
external: {{cmd_vel: Twist}}
nodes:
  simulator:
    run: {ROOT}/nodes/simulator.py
    inputs: {{cmd_vel: cmd_vel}}
    outputs: {{truth: truth}}
    params: {{rate: 50, robot: {{seed: 1}}}}
  imu:
    run: {ROOT}/nodes/imu.py
    outputs: {{data_raw: imu/data_raw, mag_raw: imu/mag_raw}}
    params: {{bus: sim, rate: 100}}
  calibrate:
    run: {ROOT}/nodes/calibrate.py
    inputs: {{data_raw: imu/data_raw, mag_raw: imu/mag_raw}}
    outputs: {{data: imu/data, mag: imu/mag}}
    params: {{file: FILE}}
  encoders:
    run: {ROOT}/nodes/encoders.py
    outputs: {{wheels: wheels}}
    params: {{bus: sim, rate: 50}}
  odometry:
    run: {ROOT}/nodes/odometry.py
    inputs: {{wheels: wheels}}
    outputs: {{odom: odom}}
    params: {{wheel_radius: 0.03, track: 0.112, ticks_per_turn: 16384}}
"""
TURNED = f"""
name: bench
nodes:
  board:
    run: {Path(__file__).with_name("turned_board.py")}
    outputs: {{truth: truth}}
  imu:
    run: {ROOT}/nodes/imu.py
    outputs: {{data_raw: imu/data_raw}}
    params: {{bus: sim, rate: 100}}
  calibrate:
    run: {ROOT}/nodes/calibrate.py
    inputs: {{data_raw: imu/data_raw}}
    outputs: {{data: imu/data}}
    params: {{file: FILE}}
"""


class Driver:
    """The robot goes as told; `heard` is what calibrations show to the page meanwhile."""

    def __init__(self, up: Up) -> None:
        self.client = Client(up.folder)
        self._wheel = self.client.publisher("bench/cmd_vel", encoding_of(Twist))
        self._speed = (0.0, 0.0)
        self._over = threading.Event()
        self._last: Odometry | None = None
        self._line = float("inf")
        self.driven = 0.0
        self.heard: list[dict[str, Any]] = []
        self.client.subscribe("bench/@calibrating", 64, self._hear)
        self.client.subscribe("bench/truth", 64, self._see)
        self._thread = threading.Thread(target=self._drive, daemon=True)
        self._thread.start()

    def go(self, v: float, w: float) -> None:
        self._speed = (v, w)

    def drive_a_line(self, v: float, distance: float) -> None:
        """Go ahead for so many metres, and stop; `driven` is how far it came."""
        self.driven, self._line = 0.0, distance
        self.go(v, 0.0)

    def _see(self, _key: str, data: bytes, _encoding: str) -> None:
        now, last = unpack(data, Odometry), self._last
        self._last = now
        if last is not None:
            self.driven += hypot(now.x - last.x, now.y - last.y)
        if self.driven >= self._line:
            self._speed = (0.0, 0.0)

    def _hear(self, _key: str, data: bytes, _encoding: str) -> None:
        self.heard.append(json.loads(data))

    def stands(self) -> bool:
        return self._last is not None and abs(self._last.v) + abs(self._last.w) < 1e-3

    def _drive(self) -> None:
        while not self._over.wait(0.05):
            self._wheel.put(pack(Twist(time.time_ns(), *self._speed)))

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self.client.close()


def on_terminal(up: Up, *words: str) -> tuple[int, str]:
    """Exit code and what a terminal got of a command, standard output included."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-P", "-m", "lodeline", *words]
    process = subprocess.Popen(command, env=environment(up.run), stdout=theirs, stderr=theirs)
    os.close(theirs)
    shown = b""
    while True:
        try:
            data = os.read(ours, 65536)
        except OSError:  # the last of its writers is gone
            break
        if not data:
            break
        shown += data
    os.close(ours)
    return process.wait(10.0), shown.decode()


def start(up: Up, *words: str) -> subprocess.Popen[str]:
    """A command that runs meanwhile."""
    command = [sys.executable, "-P", "-m", "lodeline", *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, env=environment(up.run), stdout=pipe, stderr=pipe, text=True)


def test_a_running_robot_is_calibrated_live_and_goes_by_it_at_once(tmp_path: Path) -> None:
    """It stands for the gyro, spins for the compass, drives a line for the wheels: the simulator's
    own values come out.
    """
    out = tmp_path / "live.yaml"
    pipeline = tmp_path / "bench.yaml"
    pipeline.write_text(PIPELINE.replace("FILE", str(out)))
    with Up(pipeline) as up:
        driver = Driver(up)
        try:
            assert up.says("CAL_MISSING")
            still = up.call("calibrate", "gyro", "-o", str(out), "--seconds", "2.5")
            assert still.returncode == 0, still.stderr
            assert "keep the robot still" in still.stderr
            assert "calibrate goes by it from now on" in still.stdout
            echo = up.call("topic", "echo", "imu/data", "-n", "20", "--json", "--timeout", "5")
            rates = [json.loads(line)["angular_velocity"] for line in echo.stdout.splitlines()]
            assert [sum(axis) / 20 for axis in zip(*rates, strict=True)] == pytest.approx(
                [0.0] * 3, abs=2e-3
            )
            driver.go(0.0, 3.5)
            code, shown = on_terminal(up, "calibrate", "mag", "-o", str(out), "--seconds", "20")
            assert code == 0, shown
            turning = up.call("calibrate", "gyro", "-o", str(out), "--seconds", "2.1")
            assert turning.returncode == 1, turning.stdout
            assert "wheel rolled by" in turning.stderr
            rolling = up.call("calibrate", "wheels", "--distance", "0.6", "--seconds", "1")
            assert rolling.returncode == 1, rolling.stdout
            assert "REFUSED wheels: the wheels never stood still" in rolling.stderr
            line = start(up, "calibrate", "wheels", "--distance", "0.6", "-o", str(out))
            driver.go(0.0, 0.0)  # what it still turns is not counted
            assert eventually(
                lambda: (
                    (driver.heard[-1]["kind"], driver.heard[-1]["state"]) == ("wheels", "running")
                )
            )
            assert eventually(driver.stands)  # to a hundredth of a turn it did when it was asked
            driver.drive_a_line(0.4, 0.6)
            said, asked = line.communicate(timeout=30.0)
            assert line.returncode == 0, asked
        finally:
            driver.close()
    found, _ = calibrated(ImuCalibration(), str(out))
    assert found.gyro_zero == pytest.approx((0.012, -0.008, 0.006), abs=1e-3)
    assert found.mag_offset[:2] == pytest.approx((11.5e-6, -1.0e-6), abs=0.6e-6)
    assert "of 2 turns" in shown and "\u25cf" in shown and "before" in shown
    assert "uT off its centre, heading wrong by" in shown
    compass = [said for said in driver.heard if said["kind"] == "mag"]
    assert all(said["state"] == "running" for said in compass[:-1])
    assert sum(compass[0]["parts"]) < 6 < 23 < sum(compass[-2]["parts"])
    end = compass[-1]
    assert end["state"] == "written"
    assert len(end["circles"]["after"]) > 40
    assert [each["state"] for each in driver.heard if each["kind"] == "gyro"][-1] == "refused"
    assert "drive as you said, then stop" in asked
    assert "odometry goes by it now, until it is started again" in said
    assert "write into the params of nodes/odometry.py: {wheel_radius: 0.02" in said
    radius = load(out).sections["wheels"]["wheel_radius"]
    assert radius == pytest.approx(
        0.0215 * 0.6 / driver.driven, rel=5e-3
    )  # grip wanders by as much
    assert driver.heard[-1]["state"] == "written"


def test_a_board_that_is_laid_on_its_six_sides_measures_gravity_from_then_on(
    tmp_path: Path,
) -> None:
    out = tmp_path / "live.yaml"
    pipeline = tmp_path / "bench.yaml"
    pipeline.write_text(TURNED.replace("FILE", str(out)))
    with Up(pipeline) as up:
        short = up.call("calibrate", "accel", "-o", str(out), "--seconds", "2")
        assert short.returncode == 1, short.stdout
        assert "REFUSED accel: lay it down with its" in short.stderr
        assert not out.exists()
        code, shown = on_terminal(up, "calibrate", "accel", "-o", str(out))
        assert code == 0, shown
        forces = up.call("topic", "echo", "imu/data", "-n", "100", "--json", "--timeout", "10")
    assert "lay the sensor on each of its six sides" in shown
    assert "[x] x up" in shown and "[ ] z down" in shown
    assert "positions" in shown
    assert "calibrate goes by it from now on" in shown
    found, _ = calibrated(ImuCalibration(), str(out))
    assert found.accel_offset == pytest.approx(OFFSET, abs=0.02)
    assert [s * t for s, t in zip(found.accel_scale, SCALE, strict=True)] == pytest.approx(
        [1.0] * 3, abs=2e-3
    )
    samples = [json.loads(line)["linear_acceleration"] for line in forces.stdout.splitlines()]
    lengths = sorted(hypot(*force) for force in samples)
    assert lengths[2] > GRAVITY - 0.15 and lengths[-3] < GRAVITY + 0.15
