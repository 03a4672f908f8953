"""Claims about `lodeline bench attitude`: what it counts as an error, and what updates cost."""

from __future__ import annotations

import json
from math import radians
from pathlib import Path

import pytest

from lodeline.attitude.score import attitude_error
from lodeline.bench.attitude import ours
from lodeline.bench.attitude_speed import UNIT, measure
from lodeline.bench.peers import installed
from lodeline.cli import main
from lodeline.rotation import Vector, conjugate, from_euler, multiply, rotate

HEADER = "t_s,gx,gy,gz,ax,ay,az,mx,my,mz,qw,qx,qy,qz,moving"
FIELD: Vector = (0.0, 20.0, -40.0)
GRAVITY: Vector = (0.0, 0.0, 9.80665)
SPIN = 0.4  # rad/s about the vertical, from the third second on


def turning(off_heading: float, off_roll: float, *, lost: bool = False) -> str:
    """A body tilted by 0.2 rad that turns; the truth is off by so much in the world's axes."""
    lines = [HEADER]
    off = multiply(from_euler(0.0, 0.0, off_heading), from_euler(off_roll, 0.0, 0.0))
    for i in range(1000):
        spin = SPIN if i >= 300 else 0.0
        q = multiply(
            from_euler(0.0, 0.0, 0.3 + SPIN * 0.01 * max(0.0, i - 299.5)),
            from_euler(0.2, 0.0, 0.0),
        )
        back = conjugate(q)
        sensors = (
            *rotate(back, (0.0, 0.0, spin)),
            *rotate(back, GRAVITY),
            *rotate(back, FIELD),
        )
        x, y, z, w = multiply(off, q)
        moving = i >= 300
        # where nobody should look, the truth is nonsense or missing
        truth = (w, x, y, z) if moving else (0.0, 1.0, 0.0, 0.0)
        cells = [f"{v:.9f}" for v in (0.01 * i, *sensors)]
        cells += ["" if lost and i % 2 else f"{v:.9f}" for v in truth]
        lines.append(",".join([*cells, str(int(moving))]))
    return "\n".join([*lines, ""])


def bench(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> dict[str, dict[str, dict[str, float]]]:
    assert main(["bench", "attitude", str(folder), "--json"]) == 0
    results: dict[str, dict[str, dict[str, float]]] = json.loads(capsys.readouterr().out)
    return results


def test_errors_are_those_of_the_truth_over_moving_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "heading.csv").write_text(turning(radians(3.0), 0.0))
    (tmp_path / "tilt.csv").write_text(turning(0.0, radians(2.0), lost=True))
    for method, files in bench(tmp_path, capsys).items():
        if method not in ("soft", "mekf", "gyro", "tilt_compass"):
            continue
        heading, tilt = files["heading"], files["tilt"]
        assert heading["heading"] == pytest.approx(3.0, abs=0.15), method
        assert heading["inclination"] == pytest.approx(0.0, abs=0.1), method
        assert tilt["inclination"] == pytest.approx(2.0, abs=0.1), method
        assert tilt["total"] == pytest.approx(2.0, abs=0.1), method


def test_the_table_ranks_all_methods_by_their_mean(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "one.csv").write_text(turning(0.0, 0.0))
    assert main(["bench", "attitude", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = lines[1 : lines.index("")]
    totals = [float(row[row.index(".") - 3 :].split()[0]) for row in rows]
    assert totals == sorted(totals)
    names = {row.partition("  ")[0] for row in rows}
    assert names == {*ours(), *installed()}
    assert rows[-1].startswith("compass ")  # it takes a tilted field for a level one


def test_files_without_truth_are_named_and_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plain.csv").write_text("t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n")
    assert main(["bench", "attitude", str(tmp_path)]) == 4
    said = capsys.readouterr().err
    assert "plain.csv: no column qw, left out" in said
    assert "no recording with qw" in said


def test_an_unknown_bench_is_a_usage_error_that_names_the_known(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["bench", "atitude"])
    assert end.value.code == 2
    assert "attitude" in capsys.readouterr().err


def test_peers_that_are_installed_agree_about_a_calm_turn(tmp_path: Path) -> None:
    """Their axes are ours, whatever they call them: within six degrees at the end."""
    from lodeline.recording.csv_table import CsvTable
    from lodeline.recording.imu_csv import read_imu

    if not installed():
        pytest.skip("none of vqf, imufusion, ahrs is installed")
    file = tmp_path / "one.csv"
    file.write_text(turning(0.0, 0.0))
    with CsvTable(file) as table:
        rows = list(read_imu(table, ("qw", "qx", "qy", "qz")))
    w, x, y, z = (v or 0.0 for v in rows[-1].extra)
    for name, maker in installed().items():
        peer = maker(0.01)
        for row in rows:
            peer.update(0.01, row.angular_velocity, row.linear_acceleration, row.magnetic_field)
        assert attitude_error(peer.orientation, (x, y, z, w)).total < radians(6.0), name


def test_the_default_costs_at_most_three_and_a_half_times_the_published_method() -> None:
    makers = {name: maker for name, maker in ours().items() if name in ("soft", UNIT)}
    costs = measure(makers, rounds=6)
    assert costs["soft"] <= 3.5 * costs[UNIT]
