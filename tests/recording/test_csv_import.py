"""Any CSV table becomes a recording by a map of its columns, looked at before it is written."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from pathlib import Path

import pytest

from lodeline.pipeline.faults import PipelineError
from lodeline.recording import RecordingError
from lodeline.recording.csv_guess import propose
from lodeline.recording.csv_map import read_map, samples
from lodeline.recording.imu_csv import CsvTable
from lodeline.recording.read import Recording
from lodeline_msgs import MESSAGES, Imu, MagneticField, Message, WheelTicks

Tool = Callable[[list[str]], int]
Capture = pytest.CaptureFixture[str]

TABLE = """\
# from the logger of a robot nobody knows
time (ms);enc left;step right;gx;gy;gz [deg/s];acc_x (g);acc_y (g);acc_z (g);note
0;0;0;0;0;90;0;0;1;start
10;5;2;0;0;-90;0;0;1;
20;9;3;0;0;45;0;;1;no y
"""
MAP = """\
time: time (ms) * ms
wheels:
  type: WheelTicks
  left: -enc left
  right: sum(step right)
imu/data_raw:
  type: Imu
  angular_velocity: [0, gy, "gz [deg/s] * deg"]
  linear_acceleration: [acc_x (g) * g, acc_y (g) * -9.80665, acc_z (g) * g]
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    file = tmp_path / "run.csv"
    file.write_text(TABLE)
    return file


def write_map(folder: Path, text: str = MAP) -> Path:
    file = folder / "map.yaml"
    file.write_text(text)
    return file


def read(table: Path, text: str = MAP) -> list[tuple[str, Message]]:
    with CsvTable(table) as opened:
        return list(samples(opened, read_map(write_map(table.parent, text), opened.columns)))


def test_a_decimal_comma_is_one_between_semicolons_and_named_between_commas(tmp_path: Path) -> None:
    file, mapping = tmp_path / "run.csv", "time: t\nwheels: {type: WheelTicks, left: a, right: a}\n"
    file.write_text("t;a\n0;1\n0,25;2,0\n")
    assert read(file, mapping)[1][1] == WheelTicks(250_000_000, 2, 2, seq=1)
    for text, said in (
        ("t;a\n0,5;1\n0.75;2\n", r"csv:3: t is '0\.75', but rows before have a decimal ','"),
        ("t,a\n0,25,2,0\n", r"csv:2: 4 columns.*decimal commas, write points, or `;`"),
        ('t,a\n"0,25",2\n', r"csv:2: t is '0,25', expected a number with a decimal point"),
    ):
        file.write_text(text)
        with pytest.raises(RecordingError, match=said):
            read(file, mapping)


def test_a_table_without_names_is_told_so(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("# logged\n0.0,6,18,\n0.1,7,19,\n")
    with pytest.raises(RecordingError, match="csv:2: numbers, expected the names of the columns"):
        CsvTable(file)


def test_columns_become_fields_with_sign_unit_sum_and_constant(table: Path) -> None:
    g = 9.80665
    assert read(table) == [
        ("wheels", WheelTicks(0, 0, 0, seq=0)),
        ("imu/data_raw", Imu(0, (0.0, 0.0, pi / 2), (0.0, 0.0, g), seq=0)),
        ("wheels", WheelTicks(10_000_000, -5, 2, seq=1)),
        ("imu/data_raw", Imu(10_000_000, (0.0, 0.0, -pi / 2), (0.0, -0.0, g), seq=1)),
        ("wheels", WheelTicks(20_000_000, -9, 5, seq=2)),
        # acc_y of the last row is empty: no sample of the IMU
    ]


def test_the_recording_holds_what_the_map_says(table: Path, bag: Tool, capsys: Capture) -> None:
    out = table.with_name("run.mcap")
    map_file = str(write_map(table.parent))
    assert bag(["import", str(table), "--map", map_file, "-o", str(out)]) == 0
    assert "3 rows of" in capsys.readouterr().out
    with Recording(out) as recording:
        assert [(s.key, s.message) for s in recording.samples()] == read(table)


def test_preview_shows_samples_and_writes_nothing(table: Path, bag: Tool, capsys: Capture) -> None:
    before = write_map(table.parent)
    assert bag(["import", str(table), "--map", str(before), "--preview"]) == 0
    out = capsys.readouterr().out
    assert "left   0            -5           -9" in out
    assert "angular_velocity_z     1.5707963267948966  -1.5707963267948966" in out
    assert sorted(path.name for path in table.parent.iterdir()) == ["map.yaml", "run.csv"]


def test_the_proposed_map_imports_a_common_table(
    tmp_path: Path, bag: Tool, capsys: Capture
) -> None:
    table = tmp_path / "imu.csv"
    table.write_text("t_s,gx,gy,gz,ax,ay,az,mx,my,mz\n0,0,0,1,0,0,9.8,20,0,-40\n")
    assert bag(["import", str(table), "--preview"]) == 0
    proposed, shown = capsys.readouterr()
    assert "gz      1" in shown
    imu, mag = (message for _, message in read(table, proposed))
    assert imu == Imu(0, (0.0, 0.0, 1.0), (0.0, 0.0, 9.8))
    assert isinstance(mag, MagneticField)
    assert mag.magnetic_field == pytest.approx((20e-6, 0.0, -40e-6))


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        (("Time_us", "x"), "time: Time_us * us"),
        (("timestamp", "left_ticks", "right_ticks"), "  right: right_ticks"),
        (("t", *(f"gyro_{a} (dps)" for a in "xyz"), *(f"acc{a}" for a in "xyz")), "  type: Imu"),
        (("when", "what"), "time: WHICH_COLUMN  # seconds, or `column * ms`"),
    ],
)
def test_a_map_is_proposed_from_the_names(columns: tuple[str, ...], line: str) -> None:
    assert line in propose(columns).splitlines()


def test_without_a_map_the_way_to_one_is_shown(table: Path, bag: Tool, capsys: Capture) -> None:
    assert bag(["import", str(table)]) == 1
    assert f"lodeline bag import {table} --preview > map.yaml" in capsys.readouterr().err


def test_all_faults_of_a_map_are_told_with_their_places(table: Path) -> None:
    wrong = """\
wheels:
  type: WheelTicks
  left: enc lft
  rigth: enc left
imu/data_raw: {type: Imo}
magnets: {type: MagnetDetection, lateral: gx}
imu/data:
  type: Imu
  angular_velocity: [gx, gy]
  linear_acceleration: [gx * furlong, gy, true]
My Wheels: {type: 3}
magnet: {type: Twist, v: .nan, w: gx * inf}
"""
    with pytest.raises(PipelineError) as caught:
        read(table, wrong)
    assert [str(fault).partition("map.yaml")[2] for fault in caught.value.faults] == [
        ":1:1: `time` is missing: the column of seconds",
        ":1:1: wheels: field 'right' [tick] is missing",
        ":3:9: no column 'enc lft', did you mean 'enc left'?",
        ":4:3: WheelTicks has no field 'rigth', did you mean 'right'?",
        ":5:22: type is no message: the text \"Imo\", did you mean 'Imu'?",
        ":6:43: lateral cannot come from a table",
        ":9:21: needs 3 terms, has 2",
        ":10:25: 'furlong' is no number and no unit (deg, rpm, g, uT, gauss, mm, cm, ms, us, ns)",
        ":10:43: expected a column or a number",
        ":11:1: key 'My Wheels' may hold a-z, 0-9 and _, in parts separated by /",
        f":11:19: type is no message: 3 (known: {', '.join(MESSAGES)})",
        ":12:26: expected a column or a number",
        ":12:35: 'inf' is no number and no unit (deg, rpm, g, uT, gauss, mm, cm, ms, us, ns)",
    ]


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("5;0;0;0;0;0;0;0;1;", "time (ms) goes back: 0.005 s"),
        ("30;0.5;0;0;0;0;0;0;1;", "left is -0.5, expected a whole number"),
        (";0;0;0;0;0;0;0;1;", "time (ms) is empty, expected a time"),
        ("30;zero;0;0;0;0;0;0;1;", "enc left is 'zero', expected a number"),
        ("30;0;0", "3 columns, the header has 10"),
        (
            "30;0;0;0;0;0;0;0;1e308;",
            "linear_acceleration is larger than any number, expected something in SI",
        ),
    ],
)
def test_a_bad_row_is_named_by_file_and_line(table: Path, row: str, why: str) -> None:
    table.write_text(f"{TABLE}{row}\n")
    with pytest.raises(RecordingError) as caught:
        read(table)
    assert str(caught.value) == f"{table}:6: {why}"
