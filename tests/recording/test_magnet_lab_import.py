"""The magnet lab's text files as recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lodeline.recording import RecordingError
from lodeline.recording.magnet_lab import Row, course_setting, read_rows
from lodeline.recording.read import Recording
from lodeline_msgs import ReedBar, WheelTicks

Bag = Callable[[list[str]], int]
REST = " 0.000000" * 11


def write(tmp_path: Path, *lines: str, end: str = "\n") -> Path:
    file = tmp_path / "lab.txt"
    file.write_bytes(end.join([*lines, ""]).encode())
    return file


def test_columns_are_counts_closed_reeds_and_time_to_the_nanosecond(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        "22.000000\t51.000000\t255.000000\t699.890991" + REST,
        "-30 7.0e+01 231 2003.123456789" + REST,
        "-31 71 127 1700000000.000000001" + REST,
    )
    assert read_rows(file) == [
        Row(699_890_991_000, 22, 51, 0),
        Row(2_003_123_456_789, -30, 70, 0b00011000),
        Row(1_700_000_000_000_000_001, -31, 71, 0b10000000),
    ]


def test_comments_blank_lines_commas_and_crlf_are_taken(tmp_path: Path) -> None:
    plain = read_rows(write(tmp_path, "1 2 254 0.05" + REST, "2 3 255 0.10" + REST))
    odd = write(
        tmp_path,
        "# left, right, reeds, time",
        "",
        "1,2,254,0.05" + ",0" * 11,
        "2, 3, 255, 0.10" + ", 0" * 11 + "  # the end",
        "   ",
        end="\r\n",
    )
    assert read_rows(odd) == plain


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 2 255 0.10", "4 columns, expected 15"),
        ("1 2 255 0.10" + REST + " 0", "16 columns, expected 15"),
        ("left 2 255 0.10" + REST, "column 1: 'left', expected a number"),
        ("1 nan 255 0.10" + REST, "column 2: 'nan', expected a number"),
        ("1 2 255 1e999999999" + REST, "column 4: '1e999999999', expected a number"),
        ("1 2.5 255 0.10" + REST, "column 2: 2.5, expected a whole number"),
        ("1 2 256 0.10" + REST, "column 3: 256, expected a reed byte from 0 to 255"),
        ("1 2 -1 0.10" + REST, "column 3: -1, expected a reed byte from 0 to 255"),
        ("1 2 255 0.04" + REST, "time 0.04 goes back, expected a time after the row before"),
        ("1 2 255 1e99" + REST, "column 4: 1e99, expected a time of 0 s or more"),
        ("1e99 2 255 0.10" + REST, "column 1: 1e99, expected a whole number"),
        ("1 2 255 0.10 0 0 0 0 x 0 0 0 0 0 0", "column 9: 'x', expected a number"),
    ],
)
def test_malformed_line_is_named_and_nothing_is_written(
    line: str, message: str, tmp_path: Path, bag: Bag, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, "# two good rows", "0 0 255 0.00" + REST, "1 1 255 0.05" + REST, line)
    out = tmp_path / "out.mcap"
    assert bag(["import", str(file), "--format", "magnet-lab", "-o", str(out)]) == 1
    assert capsys.readouterr().err == f"{file}:4: {message}\n"
    assert list(tmp_path.iterdir()) == [file]


def test_file_without_rows_or_that_is_no_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"lab\.txt: no rows, expected 15 columns"):
        read_rows(write(tmp_path, "# nothing"))
    (tmp_path / "lab.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RecordingError, match="is no text, expected 15 columns"):
        read_rows(tmp_path / "lab.txt")
    with pytest.raises(RecordingError, match="there is no such file"):
        read_rows(tmp_path / "none.txt")


def test_counts_that_jump_back_are_kept(tmp_path: Path) -> None:
    counts = ["500 600", "508 610", "0 0", "8 9"]
    file = write(tmp_path, *(f"{c} 255 {0.05 * i:.2f}" + REST for i, c in enumerate(counts)))
    assert [f"{row.left} {row.right}" for row in read_rows(file)] == counts


def test_course_setting_drops_rest_keeps_each_fourth_row_and_rounds_to_45_a_turn() -> None:
    # at rest up to row 3, in motion up to row 12, at rest after
    lefts = [0, 0, 0, 0, 4, 11, 12, 20, 28, -4, -12, -11, -13, -13, -13]
    rows = [Row(i, left, 2 * left, 255 if i == 7 else 0) for i, left in enumerate(lefts)]
    assert course_setting(rows) == [
        Row(3, 0, 0, 0),
        Row(7, 24, 40, 255),  # 20 is half-way from 16 to 24: away from zero
        Row(11, -8, -24, 0),
    ]


def test_course_setting_begins_with_the_first_row_if_that_moves_already() -> None:
    rows = [Row(i, 8 * i, 0, 0) for i in range(5)]
    assert [row.stamp for row in course_setting(rows)] == [0, 4]


def test_course_setting_of_a_robot_that_never_moves_is_refused(
    tmp_path: Path, bag: Bag, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, *(f"7 7 255 {0.05 * i:.2f}" + REST for i in range(5)))
    out = tmp_path / "out.mcap"
    code = bag(["import", str(file), "--format", "magnet-lab", "--course", "-o", str(out)])
    assert code == 1
    assert "no wheel moves" in capsys.readouterr().err
    assert not out.exists()


def test_import_writes_reeds_and_wheels_of_each_row(
    lab_text: Path, tmp_path: Path, bag: Bag, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.mcap"
    assert bag(["import", str(lab_text), "--format", "magnet-lab", "-o", str(out)]) == 0
    assert "400 rows" in capsys.readouterr().out
    rows = read_rows(lab_text)
    expected: list[tuple[str, object]] = []
    for seq, row in enumerate(rows):
        expected.append(("reeds", ReedBar(row.stamp, row.closed, seq=seq)))
        expected.append(("wheels", WheelTicks(row.stamp, row.left, row.right, seq=seq)))
    with Recording(out) as recording:
        assert [(key, message) for key, message, _ in recording.samples()] == expected
        assert recording.metadata["source"] == "magnet-lab text run.txt, all rows"
    assert any(row.closed for row in rows)


def test_existing_output_is_replaced_by_force_alone(
    lab_text: Path, tmp_path: Path, bag: Bag, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.mcap"
    out.write_text("precious")
    command = ["import", str(lab_text), "--format", "magnet-lab", "-o", str(out)]
    assert bag(command) == 1
    assert "exists already" in capsys.readouterr().err
    assert out.read_text() == "precious"
    assert bag([*command, "--force"]) == 0
    with Recording(out) as recording:
        assert recording.channels["wheels"].count == 400
