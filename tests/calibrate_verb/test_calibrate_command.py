"""Claims about `lodeline calibrate` from files: what it finds and what it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, degrees, pi, radians, sin
from pathlib import Path
from random import Random
from typing import Any

import pytest

from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.calibration_file import calibrated, load, previous, store
from lodeline.cli import main
from lodeline.loading import load_node
from lodeline.odometry import OdometryParams
from lodeline.recording.write import RecordingWriter, whole_file
from lodeline.rotation import Vector, wrap_angle
from lodeline_msgs import Imu, MagneticField, Message, WheelTicks
from tests.support.live import ROOT

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


def test_a_flat_turn_leaves_the_z_of_the_file_as_it_is(tmp_path: Path, out: Path) -> None:
    store(out, "mag", {"mag_offset": [0, 0, 6e-6], "mag_matrix": [1, 0, 0, 0, 1, 0, 0, 0, 1.01]})
    mag = table(
        tmp_path / "turn.csv",
        "t_s,mx,my,mz",
        [(0.02 * i, *m) for i, (_, m) in enumerate(turn(2.1 * pi))],
    )
    assert main(["calibrate", "mag", "--from", str(mag), "-o", str(out)]) == 0
    section = load(out).sections["mag"]
    assert section["mag_offset"][2] == 6e-6
    assert section["mag_matrix"][8] == 1.01
    assert section["mag_offset"][0] == pytest.approx(IRON[0] * 1e-6, abs=0.3e-6)


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
    arguments = ["calibrate", "wheels", "-o", str(out), "--ticks-per-turn", "360"]
    assert main([*arguments, "--from", str(bag), "--distance", "3"]) == 0
    assert "left_sign: -1, right_sign: 1" in capsys.readouterr().out
    around = round(5.0 * pi * 0.112 * metres)
    csv = table(tmp_path / "spin.csv", "t_s,left,right", [(0, 0, 0), (20, around, around)])
    assert main([*arguments, "--from", str(csv), "--turns", "5"]) == 0
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
        (
            "accel",
            [],
            [(0.01 * i, *w, *a) for i, (w, a) in enumerate(rest(5.0))],
            "x axis pointing",
        ),
        (
            "mag",
            [],
            [(0.01 * i, *m) for i, (_, m) in enumerate(turn(radians(200)))],
            "300 are needed",
        ),
        (
            "mag",
            [],
            [(0.01 * i, *noisy(Random(i), (32.0, -7.0, -37.0), 0.5)) for i in range(400)],
            "REFUSED mag: the readings do not change enough: turn the robot\n",
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
    more = [*more, "--ticks-per-turn", "360"] if kind == "wheels" else more
    assert main(["calibrate", kind, "--from", str(csv), "-o", str(out), *more]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"REFUSED {kind}: ")
    assert said in error
    assert out.read_bytes() == before
    assert not previous(out).exists()


def test_a_recorded_drive_is_no_rest_of_the_gyro(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "drive.mcap"
    with whole_file(bag) as stream:
        writer = RecordingWriter(stream, {})
        for i, (w, a) in enumerate(rest(4.0)):
            writer.write("imu/data_raw", Imu(10_000_000 * i, w, a))
            writer.write("wheels", WheelTicks(10_000_000 * i, 2 * i, 2 * i))
        writer.close()
    assert main(["calibrate", "gyro", "--from", str(bag), "-o", str(out)]) == 1
    assert "REFUSED gyro: the left wheel rolled by 700 counts" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("gyro --distance 2", "--distance is for wheels, this is gyro"),
        ("mag --ticks-per-turn 360", "--ticks-per-turn is for wheels, this is mag"),
        ("accel --method minmax", "--method is for mag, this is accel"),
        ("gyro --from a.csv --seconds 3", "--seconds is for a pipeline that runs, --from reads a"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(
    capsys: pytest.CaptureFixture[str], words: str, why: str
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["calibrate", *words.split()])
    assert end.value.code == 2
    assert why in capsys.readouterr().err


@pytest.mark.parametrize(
    ("place", "reason"), [("no/such.yaml", "No such file or directory"), (".", "Is a directory")]
)
def test_a_result_that_cannot_be_written_is_told_with_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str, reason: str
) -> None:
    still = [(0.01 * i, *w, *a) for i, (w, a) in enumerate(rest(4.0))]
    csv = table(tmp_path / "rest.csv", "t_s,gx,gy,gz,ax,ay,az", still)
    out = tmp_path / place
    assert main(["calibrate", "gyro", "--from", str(csv), "-o", str(out)]) == 1
    assert capsys.readouterr().err == f"{out}: cannot be written: {reason}\n"
    assert list(tmp_path.iterdir()) == [csv]


def test_calibrated_keys_are_not_taken_for_raw_ones(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = recorded(tmp_path / "c.mcap", "imu/data", [Imu(1, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))])
    assert main(["calibrate", "gyro", "--from", str(bag), "-o", str(out)]) == 1
    assert "no key .../data_raw (Imu); it has imu/data" in capsys.readouterr().err


def test_odometry_goes_by_measured_wheels_from_where_it_is(tmp_path: Path) -> None:
    file = tmp_path / "wheels.yaml"
    store(file, "wheels", {"wheel_radius": 0.043, "track": 0.2})
    node: Any = load_node(ROOT / "nodes" / "odometry.py")(OdometryParams(ticks_per_turn=360.0))
    ways: list[float] = []
    node.odom.sinks.append(lambda sample: ways.append(sample.x))
    for i, count in enumerate((0, 36, 72)):
        if i == 2:
            assert node.calibrate(file.read_bytes()).values["wheel_radius"] == 0.0215
        node.on_wheels(WheelTicks(10**8 * i, count, count))
    tenth = 0.1 * 2.0 * pi * 0.0215
    assert ways == pytest.approx([0.0, tenth, 3.0 * tenth])
    with pytest.raises(ValueError, match="crc"):
        node.calibrate(file.read_bytes().replace(b"0.043", b"0.044"))
    assert node.calibrate(b"").values["wheel_radius"] == 0.043


def test_live_without_a_pipeline_exits_with_4(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("LODELINE_RUN", str(short_folder))
    assert main(["calibrate", "gyro", "-o", str(short_folder / "c.yaml")]) == 4
    assert "no pipeline runs here" in capsys.readouterr().err
