"""Claims about the lecture's text files: one command each to odometry and dead reckoning."""

from __future__ import annotations

import csv
from math import cos, hypot, pi, sin
from pathlib import Path

import pytest

from lodeline.cli import main
from lodeline.recording.read import Recording
from lodeline_msgs import Imu, WheelTicks
from tests.dead_reckoning.test_dead_reckoning import legs, readings

METRES_PER_COUNT = 2.0 * pi * 0.14457758 / (150 * 400)
TRACK = 0.3045
LECTURE = {"path", "yaw", "speed"}  # plots that are asked for


def motor_file(file: Path, *, cumulative: bool, separator: str = " ") -> Path:
    """3 m straight, then half a circle of 1 m to the left, at 50 Hz."""
    lines = ["# Time, Counter1, Counter2, PWM1, PWM2"]
    left = right = 0
    way_left = way_right = 0.0
    for i in range(501):
        ahead = 0.0 if i == 0 else 0.012
        turn = 0.0 if i <= 250 else ahead / 1.0
        way_left += ahead - 0.5 * TRACK * turn
        way_right += ahead + 0.5 * TRACK * turn
        counts = round(way_left / METRES_PER_COUNT), round(way_right / METRES_PER_COUNT)
        shown = counts if cumulative else (counts[0] - left, counts[1] - right)
        left, right = counts
        lines.append(separator.join(map(str, (f"{0.02 * i:.3f}", *shown, 12, 12))))
    file.write_text("\n".join([*lines, ""]))
    return file


def one_command(text: Path, form: str, *more: str) -> dict[str, list[dict[str, float]]]:
    """From the text file to tables and plots; the tables of poses by their keys."""
    out, plots = text.with_suffix(""), text.parent / "plots"
    assert main(["replay", str(text), "--format", form, "--csv", str(out), *more]) == 0
    assert "--png" not in more or {f.stem for f in plots.glob("*.png")} >= LECTURE
    tables = {}
    for file in out.glob("*.csv"):
        with file.open() as table:
            tables[file.stem] = [
                {name: float(cell) for name, cell in row.items() if name in ("x", "y", "yaw", "v")}
                for row in csv.DictReader(table)
            ]
    return tables


@pytest.mark.parametrize(("cumulative", "separator"), [(False, " "), (True, ","), (False, ", ")])
def test_one_command_makes_the_path_and_its_plots_with_the_parameters_of_the_course(
    tmp_path: Path, cumulative: bool, separator: str
) -> None:
    text = motor_file(tmp_path / "motor.txt", cumulative=cumulative, separator=separator)
    more = ["--cumulative"] if cumulative else ["--png", str(tmp_path / "plots")]
    poses = one_command(text, "lecture-wheels", *more)["odom"]
    middle, end = poses[250], poses[-1]
    assert (middle["x"], middle["y"], middle["yaw"]) == pytest.approx((3.0, 0.0, 0.0), abs=1e-3)
    assert middle["v"] == pytest.approx(0.6, abs=0.01)
    # 3 m of arc of radius 1; Euler's heading is half a step behind
    assert end["x"] == pytest.approx(3.0 + sin(3.0), abs=0.02)
    assert end["y"] == pytest.approx(1.0 - cos(3.0), abs=0.02)
    assert end["yaw"] == pytest.approx(3.0, abs=1e-3)


def imu_file(file: Path, sign: int) -> Path:
    lines = ["# t wx wy wz ax ay az mx my mz temperature"]
    for i, (w, a) in enumerate(readings(legs(turns=1), noise=0.01)):
        g = [sign * v / 9.80665 for v in a]
        numbers = " ".join(f"{v:.6f}" for v in (*w, *g, 0.0, 0.0, 0.0, 25.0))
        lines.append(f"{0.01 * i:.2f} {numbers}")
    file.write_text("\n".join(lines))
    return file


@pytest.mark.parametrize("sign", [1, -1])
def test_one_command_makes_attitude_and_way_whichever_sign_gravity_has(
    tmp_path: Path, sign: int
) -> None:
    text, kept = imu_file(tmp_path / "imu.txt", sign), tmp_path / "kept.mcap"
    more = ["-o", str(kept), "--png", str(tmp_path / "plots")]
    tables = one_command(text, "lecture-imu", *more)
    assert (tmp_path / "plots" / "attitude.png").exists()
    with Recording(kept) as recording:
        first = next(each for each in recording.samples() if isinstance(each.message, Imu)).message
    assert isinstance(first, Imu)
    assert first.linear_acceleration[2] == pytest.approx(9.807, abs=0.05)
    bag = tmp_path / "imu.mcap"
    assert main(["bag", "import", str(text), "--format", "lecture-imu", "-o", str(bag)]) == 0
    with Recording(bag) as recording:
        assert recording.metadata["source"].endswith(f"gravity sign {sign:+d}")
    plain, stops = (tables[f"dead_reckoning{name}"][-1] for name in ("", "_with_stops"))
    off = {
        name: hypot(end["x"] - 0.5, end["y"] - 0.5)
        for name, end in (("plain", plain), ("stops", stops))
    }
    assert off["stops"] < 0.15
    assert off["stops"] < off["plain"]
    assert stops["yaw"] == pytest.approx(0.5 * pi, abs=0.03)


@pytest.mark.parametrize(
    ("form", "text", "said"),
    [
        ("lecture-wheels", "", "no rows"),
        ("lecture-wheels", "0 1\n", "in.txt:1: 2 columns"),
        ("lecture-wheels", "0 1 1\n1 1.5 1\n", "in.txt:2: '1.5', expected a whole number"),
        ("lecture-wheels", "1 1 1\n0 1 1\n", "in.txt:2: time 0 goes back"),
        ("lecture-wheels", "1e999 1 1\n", "in.txt:1: '1e999', expected a number"),
        ("lecture-wheels", "1e99 1 1\n", "in.txt:1: time 1e99, expected 0 s or more"),
        ("lecture-imu", "# t\n\n0 0 0 0 0 0 up\n", "in.txt:3: 'up', expected a number"),
        ("lecture-imu", "0 0 0 0 0 0\n", "in.txt:1: 6 columns"),
        ("lecture-imu", "0 0 0 0 0 0 9.81\n", "read 9.81 at the beginning, expected about 1 g"),
        ("lecture-imu", "0,01 0 0 0 0 0 1,0\n", "in.txt:1: decimal commas; write points"),
        ("lecture-wheels", "0,5;3;4\n", "in.txt:1: decimal commas; write points"),
        ("lecture-imu", "5 5 255 2023.9" + " 0" * 11, "--format magnet-lab"),
        ("lecture-wheels", "0 0 255 2023.9" + " 0" * 11, "--format magnet-lab"),
    ],
)
def test_malformed_rows_are_told_with_file_and_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], form: str, text: str, said: str
) -> None:
    file, bag = tmp_path / "in.txt", tmp_path / "out.mcap"
    file.write_text(text)
    assert main(["bag", "import", str(file), "--format", form, "-o", str(bag)]) == 1
    assert said in capsys.readouterr().err
    assert not bag.exists()


def test_counter_one_is_the_left_wheel(tmp_path: Path) -> None:
    file, bag = tmp_path / "in.txt", tmp_path / "out.mcap"
    file.write_text("0 5 0 0 0\n0.1 3 -4 0 0\n")
    main(["bag", "import", str(file), "--format", "lecture-wheels", "-o", str(bag)])
    with Recording(bag) as recording:
        last = [sample.message for sample in recording.samples()][-1]
    assert isinstance(last, WheelTicks)
    assert (last.stamp, last.left, last.right) == (100_000_000, 8, -4)
