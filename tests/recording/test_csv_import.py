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
from lodeline.recording.csv_table import CsvTable
from lodeline.recording.read import Recording
from lodeline_msgs import MESSAGES, Imu, MagneticField, Message, WheelTicks
from tests.docs.documents import blocks
from tests.support.live import ROOT

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
WHEN = "time: when\nwheels: {type: WheelTicks, left: a, right: a}\n"


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


@pytest.mark.parametrize(
    "text",
    [
        "t  left   right\n 0      1     2\n0.5    3     4\n",
        "t\tleft\tright\n0\t1\t2\n0.5\t3\t4\n",
        "t;left;right\n0;1;2\n0,5;3;4\n",
        "# savetxt\n# t left right\n0.0e+00 1.0e+00 2.0e+00\n5.0e-01 3.0e+00 4.0e+00\n",
        "#t,left,right\n0,1,2\n0.5,3,4\n",
    ],
)
def test_columns_may_be_apart_by_blanks_tabs_and_semicolons(tmp_path: Path, text: str) -> None:
    file = tmp_path / "run.csv"
    file.write_text(text)
    found = read(file, "time: t\nwheels: {type: WheelTicks, left: left, right: right}\n")
    assert [each for _, each in found] == [
        WheelTicks(0, 1, 2, seq=0),
        WheelTicks(500_000_000, 3, 4, seq=1),
    ]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2026-03-01T12:00:00Z", "2026-03-01T12:00:00.25Z"),
        ("2026-03-01 12:00:00", "2026-03-01 12:00:00,25"),
        ("2026-03-01T13:00:00+01:00", "2026-03-01T13:00:00.250+01:00"),
    ],
)
def test_a_time_may_be_in_iso_8601(tmp_path: Path, first: str, second: str) -> None:
    file = tmp_path / "run.csv"
    file.write_text(f"when;a\n{first};1\n{second};2\n")
    stamps = [each.stamp for _, each in read(file, WHEN)]
    assert stamps == [1_772_366_400_000_000_000, 1_772_366_400_250_000_000]


@pytest.mark.parametrize(
    ("map_line", "cell", "why"),
    [
        ("when", "2026-13-01T12:00:00", "when is '2026-13-01T12:00:00', expected a time as 2026-"),
        ("when", "12:00:05", "when is '12:00:05', expected a number or a time as 2026-"),
        ("when * ms", "2026-03-01", "when is '2026-03-01', expected a number"),
    ],
)
def test_a_time_that_is_none_is_told(tmp_path: Path, map_line: str, cell: str, why: str) -> None:
    file = tmp_path / "run.csv"
    file.write_text(f"when;a\n{cell};1\n")
    with pytest.raises(RecordingError, match=f"csv:2: {why}"):
        read(file, WHEN.replace("when", map_line))


def test_seconds_and_nanoseconds_of_ros_add_up_to_the_stamp(tmp_path: Path, bag: Tool) -> None:
    axes = [f"{name}.{a}" for name in ("angular_velocity", "linear_acceleration") for a in "xyz"]
    file, out = tmp_path / "ros.csv", tmp_path / "ros.mcap"
    names = ["Time", "header.seq", "header.stamp.sec", "header.stamp.nanosec", *axes]
    file.write_text(f"{','.join(names)}\n9,4,1700000000,123456789,0,0,1,0,0,9.8\n")
    with CsvTable(file) as opened:
        mapping = write_map(tmp_path, propose(opened.columns))
    assert bag(["import", str(file), "--map", str(mapping), "-o", str(out)]) == 0
    with Recording(out) as recording:
        (sample,) = recording.samples()
    assert sample.key == "imu/data_raw"
    assert sample.message == Imu(1_700_000_000_123_456_789, (0.0, 0.0, 1.0), (0.0, 0.0, 9.8))


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


def test_the_map_of_the_recording_page_is_the_one_that_is_proposed() -> None:
    (text,) = [b.text for b in blocks("docs/recording.md") if b.order == "file truth.yaml"]
    with CsvTable(ROOT / "tests" / "data" / "recordings" / "loop_truth.csv") as table:
        assert propose(table.columns) == text
    assert '  yaw: "pose.yaw (deg) * deg"\n' in propose(["t", "pos_x", "pos_y", "pose.yaw (deg)"])


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        (("Time_us", "x"), "time: Time_us * us"),
        (("timestamp", "left_ticks", "right_ticks"), "  right: right_ticks"),
        (("t", *(f"gyro_{a} (dps)" for a in "xyz"), *(f"acc{a}" for a in "xyz")), "  type: Imu"),
        (("Zeit [ms]", "Motor links", "Motor rechts"), "  right: Motor rechts"),
        (("Zeit [ms]", "x"), 'time: "Zeit [ms] * ms"'),
        (("time_ms", "x"), "time: time_ms * ms"),
        (
            ("%time", "field.header.stamp", *(f"field.angular_velocity.{a}" for a in "xyz")),
            "time: field.header.stamp",
        ),
        (
            ("__time", *(f"/imu/{v}/{a}" for v in ("acceleration", "gyro") for a in "xyz")),
            '  angular_velocity: ["/imu/gyro/x", "/imu/gyro/y", "/imu/gyro/z"]',
        ),
        (("when", "what"), "time: WHICH_COLUMN  # seconds, or `column * ms`"),
    ],
)
def test_a_map_is_proposed_from_the_names(columns: tuple[str, ...], line: str) -> None:
    assert line in propose(columns).splitlines()


@pytest.mark.parametrize(
    ("first", "unit"),
    [("1700000000", ""), ("1700000000123", " * ms"), ("1700000000123456789", " * ns"), ("-", "")],
)
def test_the_size_of_a_time_tells_its_unit(first: str, unit: str) -> None:
    assert propose(["stamp"], [first]).startswith(f"time: stamp{unit}\n")


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
