"""Claims about calibrations on file: whole or not there, the version before kept, damage named."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from random import Random
from typing import Any

import pytest

from lodeline.calibration import ImuCalibration
from lodeline.calibration_file import CalibrationFileError, calibrated, load, previous, store
from lodeline.graph import Graph
from lodeline.loading import load_node, shipped
from lodeline.params import build
from lodeline_msgs import Imu, MagneticField, Message
from tests.support.live import eventually

NODE = load_node(shipped("nodes") / "calibrate.py")
EDGES = {"data_raw": "data_raw", "mag_raw": "mag_raw"}
ZERO = {"date": "2026-01-02T03:04:05Z", "chip": "mpu9250", "gyro_zero": [0.5, 0.0, -0.25]}
IRON = {"date": "2026-01-03T03:04:05Z", "chip": "mpu9250", "mag_offset": [1e-5, 0.0, 0.0]}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "calibration.yaml"


def node(**params: Any) -> tuple[Any, Graph, list[Message]]:
    made, problems = build(NODE.params_type(), params)
    assert problems == []
    calibrate = NODE(made)
    graph = Graph({"c": calibrate}, {"c": EDGES}, {"c": {"data": "data", "mag": "mag"}})
    out: list[Message] = []
    graph.tap("data", out.append)
    graph.tap("mag", out.append)
    graph.deliver("data_raw", Imu(1, (0.5, 0.0, -0.25), (0.0, 0.0, 9.8)))
    graph.deliver("mag_raw", MagneticField(2, (3e-5, 0.0, 0.0)))
    return calibrate, graph, out


def test_sections_gather_in_one_file_and_the_node_applies_them(file: Path) -> None:
    store(file, "gyro", ZERO)
    store(file, "mag", IRON)
    assert load(file).sections == {"gyro": ZERO, "mag": IRON}
    calibrate, _, (data, mag) = node(file=str(file))
    assert isinstance(data, Imu)
    assert data.angular_velocity == (0.0, 0.0, 0.0)
    assert isinstance(mag, MagneticField)
    assert mag.magnetic_field == pytest.approx((2e-5, 0.0, 0.0))
    assert calibrate.context.state == "running"


def test_what_the_file_does_not_say_stays_as_the_pipeline_has_it(file: Path) -> None:
    store(file, "gyro", ZERO)
    params = ImuCalibration(gyro_zero=(9.0, 9.0, 9.0), mounting=(0.0, 0.0, 1.5))
    made, note = calibrated(params, str(file))
    assert (made.gyro_zero, made.mounting, note) == ((0.5, 0.0, -0.25), (0.0, 0.0, 1.5), "")


def test_the_version_before_is_kept(file: Path) -> None:
    store(file, "gyro", ZERO)
    old = file.read_bytes()
    store(file, "gyro", ZERO | {"gyro_zero": [1.0, 1.0, 1.0]})
    assert previous(file).read_bytes() == old
    assert sorted(path.name for path in file.parent.iterdir()) == [file.name, f"{file.name}.prev"]


@pytest.mark.parametrize("flip", [3, 35, 60, 100])
def test_a_damaged_file_gives_way_to_the_version_before(file: Path, flip: int) -> None:
    store(file, "gyro", ZERO)
    store(file, "gyro", ZERO | {"gyro_zero": [1.0, 1.0, 1.0]})
    data = bytearray(file.read_bytes())
    data[flip] ^= 0x01
    file.write_bytes(data)
    calibrate, _, (sample, _) = node(file=str(file))
    assert isinstance(sample, Imu)
    assert sample.angular_velocity == (0.0, 0.0, 0.0)
    assert calibrate.context.state == "degraded"
    assert calibrate.context.last_error.startswith("CAL_CORRUPT")
    assert "using the version of 2026-01-02T03:04:05Z" in calibrate.context.last_error


def test_every_half_written_file_is_known_as_such(file: Path) -> None:
    store(file, "gyro", ZERO)
    whole = file.read_bytes()
    for end in range(len(whole)):
        file.write_bytes(whole[:end])
        with pytest.raises(CalibrationFileError, match="CAL_CORRUPT"):
            load(file)


def test_a_damaged_file_never_takes_the_place_of_the_version_before(file: Path) -> None:
    store(file, "gyro", ZERO)
    store(file, "mag", IRON)
    file.write_bytes(file.read_bytes()[:-5])
    store(file, "mag", IRON)
    assert load(previous(file)).sections == {"gyro": ZERO}
    assert load(file).sections == {"gyro": ZERO, "mag": IRON}


def test_a_calibration_of_another_sensor_is_refused_at_the_start_and_in_mid_run(
    file: Path,
) -> None:
    store(file, "gyro", ZERO | {"chip": "board 3"})
    calibrate, graph, out = node(file=str(file), chip="board 7")
    assert out == []
    assert calibrate.context.state == "fault"
    assert calibrate.context.last_error == (
        f"CAL_OTHER {file}: gyro was made for the chip 'board 3', this is 'board 7': "
        "run `lodeline calibrate gyro --chip 'board 7'`"
    )
    with pytest.raises(ValueError, match="made for the chip 'board 3'"):
        calibrate.calibrate(file.read_bytes())
    graph.deliver("data_raw", Imu(3, (0.5, 0.0, -0.25), (0.0, 0.0, 9.8)))
    assert out == []
    store(file, "gyro", ZERO | {"chip": "board 7"})
    calibrate.calibrate(file.read_bytes())
    graph.deliver("data_raw", Imu(4, (0.5, 0.0, -0.25), (0.0, 0.0, 9.8)))
    assert [sample.angular_velocity for sample in out if isinstance(sample, Imu)] == [(0, 0, 0)]
    assert calibrate.context.state == "running"


def test_without_any_good_file_nothing_false_is_sent_and_the_remedy_is_told(file: Path) -> None:
    calibrate, _, out = node(file=str(file))
    assert out == []
    assert calibrate.context.state == "fault"
    assert calibrate.context.last_error.startswith(f"CAL_MISSING {file}: run `lodeline calibrate")
    assert calibrate.context.rejected["no calibration"] == 2
    file.write_bytes(b"\x00\x01")
    calibrate, _, out = node(file=str(file))
    assert out == []
    assert calibrate.context.last_error.startswith("CAL_CORRUPT")


def test_a_file_by_hand_is_taken_as_it_is_and_its_mistakes_are_named(file: Path) -> None:
    file.write_text("gyro:\n  gyro_zero: [0.5, 0, -0.25]\n")
    _, _, (sample, _) = node(file=str(file))
    assert isinstance(sample, Imu)
    assert sample.angular_velocity == (0.0, 0.0, 0.0)
    file.write_text("gyro:\n  gyro_zero: [0.5, 0]\n")
    calibrate, _, out = node(file=str(file))
    assert out == []
    assert "gyro_zero must be a list of 3" in calibrate.context.last_error
    file.write_text("gyros: {}\n")
    with pytest.raises(CalibrationFileError, match="gyros is none of the sections"):
        load(file)


WRITER = """
import sys
from pathlib import Path
from lodeline.calibration_file import store
file = Path(sys.argv[1])
print("go", flush=True)
for i in range(10**9):
    store(file, "gyro", {"date": str(i), "gyro_zero": [float(i)] * 3, "verdict": "x" * 900})
"""


def test_a_writer_killed_at_any_moment_leaves_a_whole_file(file: Path) -> None:
    rng = Random(1)
    store(file, "gyro", ZERO)
    for _ in range(8):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(file)], stdout=subprocess.PIPE, text=True
        )
        assert writer.stdout is not None
        writer.stdout.readline()
        assert eventually(previous(file).exists)
        time.sleep(rng.uniform(0.005, 0.05))  # the moment of the kill, not a wait for something
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        loaded = load(file)
        assert loaded.note == ""
        assert len(loaded.sections["gyro"]["gyro_zero"]) == 3
        assert load(previous(file)).note == ""
