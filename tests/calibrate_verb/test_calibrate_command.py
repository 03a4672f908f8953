"""Claims about `lodeline calibrate`: from files and live, what it finds and what it refuses."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import atan2, cos, degrees, pi, radians, sin
from pathlib import Path
from random import Random

import pytest

from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.calibration_file import calibrated, load, previous
from lodeline.cli import main
from lodeline.recording.write import RecordingWriter, whole_file
from lodeline.rotation import Vector, wrap_angle
from lodeline_msgs import Imu, MagneticField, Message, WheelTicks
from tests.support.live import ROOT, Up, environment

ZERO: Vector = (0.02, -0.01, 0.005)
IRON: Vector = (12.0, -7.0, 3.0)  # uT
SIDES: tuple[Vector, ...] = (
    (9.8, 0.0, 0.0),
    (-9.8, 0.0, 0.0),
    (0.0, 9.8, 0.0),
    (0.0, -9.8, 0.0),
    (0.0, 0.0, 9.8),
    (0.0, 0.0, -9.8),
)


def noisy(rng: Random, v: Vector, std: float) -> Vector:
    return (rng.gauss(v[0], std), rng.gauss(v[1], std), rng.gauss(v[2], std))


def rest(seconds: float, force: Vector = (0.0, 0.0, 9.81)) -> list[tuple[Vector, Vector]]:
    """(gyro, accelerometer) of a board that lies still, at 100 Hz."""
    rng = Random(2)
    return [(noisy(rng, ZERO, 0.002), noisy(rng, force, 0.03)) for _ in range(round(100 * seconds))]


def turn(angle: float, noise: float = 0.3) -> list[tuple[float, Vector]]:
    """(yaw, field in uT) over a flat turn near iron, which also stretches x."""
    rng = Random(3)
    yaws = [angle * i / 600 for i in range(600)]
    fields = [(22.0 * sin(yaw), 20.0 * cos(yaw), -40.0) for yaw in yaws]
    return [
        (yaw, noisy(rng, (x + IRON[0], y + IRON[1], z + IRON[2]), noise))
        for yaw, (x, y, z) in zip(yaws, fields, strict=True)
    ]


def table(file: Path, header: str, rows: Sequence[Sequence[float]]) -> Path:
    lines = [header, *(",".join(map(repr, row)) for row in rows)]
    file.write_text("\n".join([*lines, ""]))
    return file


def recorded(file: Path, key: str, samples: Sequence[Message]) -> Path:
    with whole_file(file) as stream:
        writer = RecordingWriter(stream, {})
        for sample in samples:
            writer.write(key, sample)
        writer.close()
    return file


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "calibration.yaml"


def test_gyro_from_a_recording_tells_zero_date_chip_residual_and_use(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    samples = [Imu(10_000_000 * i, w, a) for i, (w, a) in enumerate(rest(4.0))]
    bag = recorded(tmp_path / "rest.mcap", "imu/data_raw", samples)
    code = main(["calibrate", "gyro", "--from", str(bag), "-o", str(out), "--chip", "mpu9250"])
    assert code == 0
    said = capsys.readouterr().out
    assert f"nodes/calibrate.py: {{file: {out}}}" in said
    section = load(out).sections["gyro"]
    assert section["gyro_zero"] == pytest.approx(ZERO, abs=3e-4)
    assert (section["chip"], section["source"]) == ("mpu9250", "rest.mcap")
    assert section["date"][:2] == "20" and section["date"][-1] == "Z"
    assert 0.0 < section["residual"] < 3e-4


def test_compass_from_a_table_takes_the_iron_out_and_keeps_what_is_in_the_file(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still = [(0.01 * i, *w, *a) for i, (w, a) in enumerate(rest(4.0))]
    gyro = table(tmp_path / "rest.csv", "t_s,gx,gy,gz,ax,ay,az", still)
    assert main(["calibrate", "gyro", "--from", str(gyro), "-o", str(out)]) == 0
    seen = turn(2.1 * pi)
    mag = table(
        tmp_path / "turn.csv", "t_s,mx,my,mz", [(0.02 * i, *m) for i, (_, m) in enumerate(seen)]
    )
    assert main(["calibrate", "mag", "--from", str(mag), "-o", str(out)]) == 0
    assert f"the version before is {previous(out)}" in capsys.readouterr().out
    assert list(load(out).sections) == ["gyro", "mag"]
    found, _ = calibrated(ImuCalibration(), str(out))
    calibrator = Calibrator(found)
    for yaw, (x, y, z) in turn(2.0 * pi, noise=0.0):
        mx, my, _ = calibrator.magnetic_field((x * 1e-6, y * 1e-6, z * 1e-6))
        assert abs(degrees(wrap_angle(atan2(mx, my) - yaw))) < 0.5
    assert found.gyro_zero == pytest.approx(ZERO, abs=3e-4)


@pytest.mark.parametrize("method", ["ellipse", "minmax"])
def test_compass_method_can_be_named(tmp_path: Path, out: Path, method: str) -> None:
    seen = turn(2.1 * pi, noise=0.05)
    samples = [
        MagneticField(20_000_000 * i, (x * 1e-6, y * 1e-6, z * 1e-6))
        for i, (_, (x, y, z)) in enumerate(seen)
    ]
    bag = recorded(tmp_path / "turn.mcap", "imu/mag_raw", samples)
    code = main(["calibrate", "mag", "--from", str(bag), "-o", str(out), "--method", method])
    assert code == 0
    offset = load(out).sections["mag"]["mag_offset"]
    assert offset == pytest.approx([IRON[0] * 1e-6, IRON[1] * 1e-6, 0.0], abs=0.2e-6)


def test_accelerometer_from_six_sides(tmp_path: Path, out: Path) -> None:
    """Scale 1.02 and offset 0.1 on z, as the sensor reads them."""
    rows = [(*w, x, y, 1.02 * z + 0.1) for side in SIDES for w, (x, y, z) in rest(1.5, side)]
    csv = table(
        tmp_path / "sides.csv",
        "t_s,gx,gy,gz,ax,ay,az",
        [(0.01 * i, *row) for i, row in enumerate(rows)],
    )
    assert main(["calibrate", "accel", "--from", str(csv), "-o", str(out)]) == 0
    section = load(out).sections["accel"]
    assert section["accel_offset"] == pytest.approx([0.0, 0.0, 0.1], abs=0.01)
    assert section["accel_scale"][2] == pytest.approx(9.80665 / 9.8 / 1.02, abs=0.001)


def test_wheels_radius_by_a_line_then_track_by_turns(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot of radius 21.5 mm and track 112 mm, 360 counts a turn, its left counter inverted."""
    metres = 360.0 / (2.0 * pi * 0.0215)
    ahead = round(3.0 * metres)
    line = [WheelTicks(0, 50, -7), WheelTicks(10**9, 50 - ahead, -7 + ahead)]
    bag = recorded(tmp_path / "line.mcap", "wheels", line)
    arguments = ["calibrate", "wheels", "--from", str(bag), "-o", str(out)]
    assert main([*arguments, "--distance", "3"]) == 0
    assert "left_sign: -1, right_sign: 1" in capsys.readouterr().out
    around = round(5.0 * pi * 0.112 * metres)
    csv = table(tmp_path / "spin.csv", "t_s,left,right", [(0, 0, 0), (20, around, around)])
    assert main(["calibrate", "wheels", "--from", str(csv), "-o", str(out), "--turns", "5"]) == 0
    section = load(out).sections["wheels"]
    assert section["wheel_radius"] == pytest.approx(0.0215, rel=1e-3)
    assert section["track"] == pytest.approx(0.112, rel=1e-3)
    assert (section["left_sign"], section["right_sign"]) == (-1, 1)


@pytest.mark.parametrize(
    ("kind", "more", "rows", "said"),
    [
        (
            "gyro",
            [],
            [(0.01 * i, 0.1 * (i // 250), 0, i % 2, 0, 0, 9.8) for i in range(500)],
            "moved",
        ),
        ("gyro", [], [(0.01 * i, *w, *a) for i, (w, a) in enumerate(rest(1.0))], "too short"),
        ("accel", [], [(0.01 * i, *w, *a) for i, (w, a) in enumerate(rest(5.0))], "too few"),
        (
            "mag",
            [],
            [(0.01 * i, *m) for i, (_, m) in enumerate(turn(radians(200)))],
            "300 are needed",
        ),
        ("wheels", ["--distance", "1"], [(0, 0, 0), (9, 4000, 3000)], "no straight line"),
        ("wheels", ["--turns", "1"], [(0, 0, 0), (9, -4000, 4000)], "radius of the wheels"),
        ("wheels", ["--distance", "1"], [(0, 0, 0), (9, 40, 40)], "drive further"),
    ],
)
def test_what_would_mislead_is_refused_and_the_file_stays(
    tmp_path: Path,
    out: Path,
    capsys: pytest.CaptureFixture[str],
    kind: str,
    more: list[str],
    rows: list[tuple[float, ...]],
    said: str,
) -> None:
    header = {"mag": "t_s,mx,my,mz", "wheels": "t_s,left,right"}.get(kind, "t_s,gx,gy,gz,ax,ay,az")
    csv = table(tmp_path / "in.csv", header, rows)
    out.write_text("gyro:\n  gyro_zero: [0, 0, 0]\n")
    before = out.read_bytes()
    assert main(["calibrate", kind, "--from", str(csv), "-o", str(out), *more]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"REFUSED {kind}: ")
    assert said in error
    assert out.read_bytes() == before
    assert not previous(out).exists()


def test_calibrated_keys_are_not_taken_for_raw_ones(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = recorded(tmp_path / "c.mcap", "imu/data", [Imu(1, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))])
    assert main(["calibrate", "gyro", "--from", str(bag), "-o", str(out)]) == 1
    assert "no key .../data_raw (Imu); it has imu/data" in capsys.readouterr().err


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
"""


@contextmanager
def driven(up: Up, *speed: str) -> Iterator[None]:
    """The robot goes as told, from when it hears of it."""
    command = [sys.executable, "-P", "-m", "lodeline", "topic", "pub", "cmd_vel", *speed]
    sender = subprocess.Popen(
        [*command, "--rate", "10", "--json"],
        env=environment(up.run),
        stdout=subprocess.PIPE,
        text=True,
    )
    assert sender.stdout is not None
    try:
        for _ in range(5):
            sender.stdout.readline()
        yield
    finally:
        sender.terminate()
        sender.wait()
        sender.stdout.close()


def test_a_running_robot_is_calibrated_live(tmp_path: Path) -> None:
    """It stands for the gyro and spins for the compass; the simulator's own values come out."""
    pipeline = tmp_path / "bench.yaml"
    pipeline.write_text(PIPELINE)
    out = str(tmp_path / "live.yaml")
    with Up(pipeline) as up:
        with driven(up, "v=0", "w=0"):
            still = up.call("calibrate", "gyro", "-o", out, "--seconds", "3")
        assert still.returncode == 0, still.stderr
        assert "keep the robot still" in still.stderr
        with driven(up, "v=0", "w=2.5"):
            turning = up.call("calibrate", "gyro", "-o", out, "--seconds", "3")
            compass = up.call("calibrate", "mag", "-o", out, "--seconds", "20")
        assert turning.returncode == 1, turning.stdout
        assert compass.returncode == 0, compass.stderr
    found, _ = calibrated(ImuCalibration(), out)
    assert found.gyro_zero == pytest.approx((0.012, -0.008, 0.006), abs=1e-3)
    assert found.mag_offset[:2] == pytest.approx((11.5e-6, -1.0e-6), abs=0.6e-6)


def test_live_without_a_pipeline_exits_with_4(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("LODELINE_RUN", str(short_folder))
    assert main(["calibrate", "gyro", "-o", str(short_folder / "c.yaml")]) == 4
    assert "no pipeline runs here" in capsys.readouterr().err
