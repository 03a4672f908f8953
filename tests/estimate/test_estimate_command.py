"""Claims about `lodeline estimate`: what it reads, what it writes, and what it says is wrong."""

from __future__ import annotations

import csv
import gzip
from math import pi, sqrt
from pathlib import Path

import pytest

from lodeline.attitude import METHODS, make_attitude
from lodeline.cli import main

NORTH = "t_s,gx,gy,gz,ax,ay,az,mx,my,mz"
RATE, FORCE, FIELD = (0.01, -0.02, 0.3), (0.3, -0.2, 9.8), (5.0, 18.0, -40.0)
POSE = ["t_s", "qx", "qy", "qz", "qw", "roll", "pitch", "yaw"]
BIAS = ["bias_x", "bias_y", "bias_z"]


def table(header: str, *rows: str) -> str:
    return "\n".join([header, *rows, ""])


def turning(seconds: float = 3.0) -> str:
    numbers = ",".join(map(str, (*RATE, *FORCE, *FIELD)))
    return table(NORTH, *(f"{0.01 * i:.2f},{numbers}" for i in range(round(seconds * 100))))


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    file = tmp_path / "in.csv"
    file.write_text(turning())
    return file


def run(source: Path, *more: str) -> tuple[int, list[dict[str, str]]]:
    out = source.with_name("out.csv")
    code = main(["estimate", str(source), "-o", str(out), *more])
    return code, list(csv.DictReader(out.open())) if out.exists() else []


@pytest.mark.parametrize("method", METHODS)
def test_each_row_has_what_the_library_gives(recording: Path, method: str) -> None:
    code, rows = run(recording, "--method", method)
    assert code == 0
    assert len(rows) == 300
    estimator = make_attitude(method)
    x, y, z = FIELD
    last = 0.0
    for i, row in enumerate(rows):
        dt, last = float(row["t_s"]) - last, float(row["t_s"])
        estimator.update(dt, RATE, FORCE, (x * 1e-6, y * 1e-6, z * 1e-6))
        assert last == pytest.approx(0.01 * i, abs=1e-9)
        q = [float(row[name]) for name in POSE[1:5]]
        assert q == pytest.approx(estimator.orientation, abs=1e-8)
        assert float(row["heading_std"]) == pytest.approx(estimator.heading_std)
    has_bias = method in ("soft", "mekf", "dcm")
    assert list(rows[0]) == POSE + (BIAS if has_bias else []) + ["heading_std"]


def test_facing_north_uphill_is_yaw_90_and_pitch_up_is_negative(tmp_path: Path) -> None:
    """Nose up by 0.1 rad: specific force leans to +x, and REP-103 pitch is nose down."""
    file = tmp_path / "in.csv"
    row = "0,0,0,0.979,0,9.758,20,0,-40"
    file.write_text(table(NORTH, *(f"{t},{row}" for t in (0, 1, 2))))
    _, rows = run(file, "--method", "tilt_compass")
    assert float(rows[-1]["pitch"]) == pytest.approx(-0.1, abs=1e-3)
    assert float(rows[-1]["roll"]) == pytest.approx(0.0, abs=1e-9)
    assert float(rows[-1]["yaw"]) == pytest.approx(0.5 * pi, abs=1e-8)


def test_columns_count_by_name_and_others_are_left_alone(recording: Path) -> None:
    _, plain = run(recording)
    lines = [line.split(",") for line in recording.read_text().split()]
    mixed = [["#label"[1:], *line[::-1]] for line in lines]
    for line in mixed[1:]:
        line[0] = "walking"
    recording.write_text("# made by hand\n" + table(*(", ".join(line) for line in mixed)))
    code, rows = run(recording)
    assert code == 0
    assert rows == plain


def test_a_gzipped_table_gives_the_same(recording: Path) -> None:
    _, plain = run(recording)
    packed = recording.with_name("in.csv.gz")
    packed.write_bytes(gzip.compress(recording.read_bytes()))
    assert run(packed) == (0, plain)


def test_without_a_magnetometer_the_heading_is_unknown_but_the_tilt_is_not(tmp_path: Path) -> None:
    file = tmp_path / "in.csv"
    header = NORTH.removesuffix(",mx,my,mz")
    file.write_text(table(header, *(f"{i / 100},0,0,0,0,0.979,9.758" for i in range(300))))
    _, rows = run(file)
    assert float(rows[-1]["roll"]) == pytest.approx(0.1, abs=1e-3)
    assert float(rows[-1]["heading_std"]) == pytest.approx(pi / sqrt(3.0))


def test_an_empty_field_is_no_sample_of_the_magnetometer(recording: Path) -> None:
    """A compass at 50 Hz beside a gyro at 100: what is not there does not count as a reading."""
    lines = recording.read_text().split()
    recording.write_text(
        table(
            lines[0],
            *(x if i % 2 else x.rsplit(",", 3)[0] + ",,nan," for i, x in enumerate(lines[1:])),
        )
    )
    code, rows = run(recording, "--method", "compass")
    assert code == 0
    assert float(rows[0]["heading_std"]) == pytest.approx(pi / sqrt(3.0))
    assert float(rows[1]["heading_std"]) < 0.1


GOOD = "0,0,0,0,0,0,9.8,0,20,-40"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "in.csv: is empty"),
        (NORTH, "in.csv: no rows"),
        (table("time,gx,gy,gz,ax,ay,az", GOOD), "in.csv:1: no column t_s"),
        (table("t_s,gx,gy,gZ,ax,ay,az", GOOD), "in.csv:1: no column gz (columns: t_s, gx, gy, gZ,"),
        (table(NORTH + ",gx", GOOD + ",0"), "in.csv:1: column gx stands twice"),
        (table("t_s,gx,gy,gz,ax,ay,az,mx,my", "0" + ",0" * 8), "in.csv:1: no column mz"),
        (table(NORTH, GOOD, "0.1,0,0,0"), "in.csv:3: 4 columns, the header has 10"),
        (table(NORTH, GOOD.replace("9.8", "9,8", 1)), "in.csv:2: 11 columns"),
        (table(NORTH, GOOD.replace("9.8", "up")), "in.csv:2: az is 'up', expected a number"),
        (table(NORTH, GOOD.replace("9.8", "inf")), "in.csv:2: az is 'inf', expected a number"),
        (table(NORTH, GOOD.replace("9.8", "")), "in.csv:2: az is empty"),
        (table(NORTH, GOOD.replace("9.8", "nan")), "in.csv:2: az is 'nan', expected a number"),
        (table(NORTH, GOOD.replace("9.8", "1e7")), "in.csv:2: not a measurement"),
        (table(NORTH, "1" + GOOD[1:], GOOD), "in.csv:3: time goes back"),
    ],
)
def test_what_is_wrong_is_told_with_file_and_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    file = tmp_path / "in.csv"
    file.write_text(text)
    code, rows = run(file)
    assert (code, rows) == (1, [])
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("data", [b"\xff\xfe\x00\x01", b"\x1f\x8b\x08\x00junk"])
def test_what_is_no_table_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], data: bytes
) -> None:
    file = tmp_path / "in.csv"
    file.write_bytes(data)
    assert run(file)[0] == 1
    assert "in.csv" in capsys.readouterr().err


def test_half_a_gzip_file_is_told_as_such(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    packed = recording.with_name("half.csv.gz")
    packed.write_bytes(gzip.compress(recording.read_bytes())[:-300])
    assert run(packed)[0] == 1
    assert "half.csv.gz:" in capsys.readouterr().err


def test_a_failed_run_leaves_the_old_result_as_it_was(recording: Path) -> None:
    run(recording)
    old = recording.with_name("out.csv").read_bytes()
    recording.write_text(turning(1.0) + "oops\n")
    assert run(recording)[0] == 1
    assert recording.with_name("out.csv").read_bytes() == old
    assert sorted(file.name for file in recording.parent.iterdir()) == ["in.csv", "out.csv"]


def test_a_file_that_is_not_there_and_a_place_that_cannot_be_written_are_named(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(recording)
    missing, folder = recording.with_name("typo.csv"), recording.parent
    assert run(missing)[0] == 4
    assert capsys.readouterr().err.endswith(f"{missing}: there is no such file\n")
    assert main(["estimate", str(recording), "-o", str(folder)]) == 1
    assert capsys.readouterr().err == f"{folder}: cannot be written: is a folder\n"
    assert main(["estimate", str(recording), "-o", str(folder / "no" / "out.csv")]) == 1
    assert "out.csv: cannot be written: No such file" in capsys.readouterr().err


def test_the_input_is_never_overwritten(recording: Path) -> None:
    before = recording.read_bytes()
    assert main(["estimate", str(recording), "-o", str(recording)]) == 1
    assert recording.read_bytes() == before


def test_parameters_come_from_a_file(recording: Path) -> None:
    params = recording.with_name("params.yaml")
    params.write_text("declination: 0.1\n")
    east = float(run(recording, "--params", str(params))[1][-1]["yaw"])
    assert float(run(recording)[1][-1]["yaw"]) - east == pytest.approx(0.1, abs=1e-6)


def test_wrong_parameters_are_told_with_their_place(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    params = recording.with_name("params.yaml")
    params.write_text("tau: 3\ndeclinaton: 0.1\n")
    assert run(recording, "--method", "complementary", "--params", str(params))[0] == 3
    said = capsys.readouterr().err
    assert "params.yaml:2:1: unknown parameter 'declinaton', did you mean 'declination'?" in said
    params.write_text("tau: -3\n")
    assert run(recording, "--method", "complementary", "--params", str(params))[0] == 3
    assert "params.yaml:1:6: tau must be above zero" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("row", "last", "doubts"),
    [
        ("0,0,0,0,0,1,0,2e-5,-4e-5", 0.02, ["is it in g?", "is it in tesla"]),
        ("0,0,90,0,0,9.81,0,200,-400", 0.02, ["are they in deg/s?", "is it in mG"]),
        ("0,0,0,0,0,9.81,0,20,-40", 20, ["is t_s in ms?"]),
        ("0,0,1,0,0,9.81,0,20,-40", 0.02, []),
    ],
)
def test_readings_in_another_unit_are_doubted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], row: str, last: float, doubts: list[str]
) -> None:
    file = tmp_path / "in.csv"
    file.write_text(table(NORTH, f"0,{row}", f"{last},{row}"))
    assert run(file)[0] == 0
    said = capsys.readouterr().err
    assert said.count("?") == len(doubts)
    assert all(doubt in said for doubt in doubts)
