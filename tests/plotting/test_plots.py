"""Claims about plots: they show what the recording holds, and say what it lacks."""

from __future__ import annotations

import json
import math
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from mcap.reader import make_reader

from lodeline.cli import main
from lodeline.ekf import LocalizerParams
from lodeline.ekf.belief import Belief
from lodeline.ekf.distances import Distances
from lodeline.ekf.samples import Hits, Motion
from lodeline.plotting.figure import Figure
from lodeline.plotting.kinds import KINDS, figures
from lodeline.plotting.magnets import distances
from lodeline.plotting.numbers import chi_square_band
from lodeline.plotting.run import Run
from lodeline.recording import RecordingError
from lodeline_msgs import MagnetDetection, PoseEstimate
from tests.support.live import ROOT


def read(file: Path, key: str) -> list[dict[str, Any]]:
    """Samples of a key as MCAP's own reader has them, the last of each stamp."""
    with file.open("rb") as stream:
        samples = [
            msgpack.unpackb(message.data)
            for _, _, message in make_reader(stream).iter_messages(topics=[key])
        ]
    return list({each["stamp"]: each for each in samples}.values())


def made(file: Path) -> dict[str, Figure]:
    found, _ = figures(Run(file))
    return {each.kind: each for each in found}


def curve(figure: Figure, name: str, panel: int = 0) -> tuple[list[float], list[float]]:
    """x and y of the curve of that name."""
    curves = figure.floor.trails if figure.floor else figure.panels[panel].curves
    (found,) = [each for each in curves if each.name == name]
    return list(found.x), [math.nan if value is None else value for value in found.y]


def test_path_heading_and_speed_are_those_of_the_recording(rover: Path) -> None:
    plots = made(rover)
    poses, odometry, truth = (read(rover, key) for key in ("pose", "odom", "truth"))
    for name, samples in (("pose (EKF)", poses), ("odom", odometry), ("truth", truth)):
        x, y = curve(plots["path"], name)
        assert x == [each["x"] for each in samples]
        assert y == [each["y"] for each in samples]
        times, yaw = curve(plots["yaw"], name)
        assert yaw == pytest.approx([math.degrees(each["yaw"]) for each in samples], abs=1e-9)
        steps = [(each["stamp"] - samples[0]["stamp"]) * 1e-9 for each in samples]
        assert [time - times[0] for time in times] == pytest.approx(steps, abs=1e-12)
    assert curve(plots["speed"], "odom")[1] == [each["v"] for each in odometry]
    rates = [math.degrees(each["w"]) for each in odometry]
    assert curve(plots["yaw_rate"], "odom")[1] == pytest.approx(rates, abs=1e-12)


def test_sigmas_bias_and_errors_are_those_of_the_recording(rover: Path) -> None:
    plots = made(rover)
    poses, attitudes = read(rover, "pose"), read(rover, "attitude")
    sigma = [math.degrees(math.sqrt(each["covariance"][8])) for each in poses]
    assert curve(plots["sigmas"], "σ yaw", 1)[1] == pytest.approx(sigma, rel=1e-12)
    assert curve(plots["heading_std"], "pose")[1] == pytest.approx(sigma, rel=1e-12)
    bias = [math.degrees(each["gyro_bias"][2]) for each in attitudes]
    assert curve(plots["gyro_bias"], "bz")[1] == pytest.approx(bias, rel=1e-12)
    truth = {each["stamp"]: each for each in read(rover, "truth")}
    start = Run(rover).start
    stamps = [start + round(time * 1e9) for time in curve(plots["errors"], "error")[0]]
    errors = dict(zip(stamps, curve(plots["errors"], "error")[1], strict=True))
    same = [each for each in poses if each["stamp"] in truth and each["stamp"] in errors]
    assert len(same) > 100
    for each in same:
        off = 1e3 * (each["x"] - truth[each["stamp"]]["x"])
        assert errors[each["stamp"]] == pytest.approx(off, abs=1e-9)


def test_a_closed_reed_is_a_bar_as_long_as_it_is_closed(loop: Path) -> None:
    (panel,) = made(loop)["reeds"].panels
    samples = read(loop, "reeds")
    start = samples[0]["stamp"]
    for i, (sample, after) in enumerate(pairwise(samples)):
        middle = (0.5 * (sample["stamp"] + after["stamp"]) - start) * 1e-9
        shown = {row for row, begin, end in panel.spans if begin <= middle < end}
        assert shown == {n + 1 for n in range(8) if sample["closed"] >> n & 1}, i


def test_the_distance_of_a_magnet_is_what_the_filter_found(loop: Path) -> None:
    """Where a reading has one magnet, which the filter told last: equal to rounding."""
    run = Run(loop)
    told = {each.stamp: each.nis for each in run.first(PoseEstimate)}
    alone = {each.stamp for each in run.first(MagnetDetection) if len(each.lateral) == 1}
    found = [each for each in distances(run) if each.stamp_ns in alone]
    assert len(found) > 100
    for each in found:
        assert each.nearest == pytest.approx(told[each.stamp_ns], rel=1e-6, abs=1e-9)
        assert len(each.neighbours) == 8
        assert min(each.neighbours) > each.nearest


def test_a_magnet_that_was_met_after_the_last_pose_is_told_too() -> None:
    told, covariance = Distances(LocalizerParams()), (1e-4, 0.0, 0.0, 1e-3)
    for i in range(4):
        told.take(Motion(i * 50_000_000, 0.004 * i, 0.0, 0.0, covariance, 0.05, 0))
        told.take(Hits(i * 50_000_000, (0.0,) if i == 2 else ()))
    assert [each.stamp_ns for each in told.found] == [100_000_000]


def test_the_bands_are_those_of_the_tables_and_nees_is_its_definition() -> None:
    assert chi_square_band(2) == pytest.approx((0.0506, 7.378), abs=5e-4)
    assert chi_square_band(3) == pytest.approx((0.2158, 9.348), abs=5e-4)
    assert chi_square_band(2, 50) == pytest.approx((74.222 / 50, 129.561 / 50), abs=1e-4)
    p = np.array([[4.0, 1.0, 0.3], [1.0, 3.0, -0.2], [0.3, -0.2, 0.5]])
    e = np.array([0.7, -1.1, 0.4])
    belief = Belief(0.0, 0.0, 0.0, 4.0, 1.0, 0.3, 3.0, -0.2, 0.5)
    assert belief.nees(*map(float, e)) == pytest.approx(float(e @ np.linalg.inv(p) @ e), rel=1e-12)


def test_every_kind_becomes_a_picture(rover: Path, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image", reason="matplotlib is not installed")
    assert main(["plot", str(rover), "--png", str(tmp_path)]) == 0
    assert {file.stem for file in tmp_path.iterdir()} == set(KINDS)
    for file in tmp_path.iterdir():
        with image.open(file) as picture:
            assert picture.width > 1000
            assert picture.height > 400
            pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
        inked = np.mean(np.any(pixels < 250, axis=1))
        coloured = np.mean(np.ptp(pixels.astype(int), axis=1) > 60)
        assert 0.01 < inked < 0.7, file
        assert coloured > 0.0005, file


def test_what_a_recording_lacks_is_left_out_and_told(
    loop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert main(["plot", str(loop), "--html", str(page), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    missing = {"attitude", "gyro_bias", "heading_std", "errors", "nees"}
    assert set(said["left_out"]) == missing
    assert said["left_out"]["nees"] == "no truth in it"
    assert set(said["plots"]) == set(KINDS) - missing
    assert main(["plot", str(loop)]) == 0
    out, err = capsys.readouterr()
    assert "left out attitude: no AttitudeEstimate in it" in err
    assert err.endswith("none drawn: --png DIR or --html FILE\n")
    assert [line.split()[0] for line in out.splitlines()] == list(said["plots"])


def test_tables_give_the_same_plots_as_the_recording(rover: Path) -> None:
    tables = rover.with_name("tables")
    told = Run(rover)
    assert told.known
    found, left_out = figures(Run(tables, told.params))
    assert left_out == {}
    assert found == figures(told)[0]
    (tables / "odom.csv").write_text((tables / "odom.csv").read_text() + "1.5,x\n")
    with pytest.raises(RecordingError, match=r"odom\.csv:\d+: "):
        Run(tables)


def test_a_recording_without_estimates_says_how_to_make_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, bag = tmp_path / "imu.txt", tmp_path / "imu.mcap"
    text.write_text("0 0 0 0 0 0 1\n0.01 0 0 0 0 0 1\n")
    assert main(["bag", "import", str(text), "--format", "lecture-imu", "-o", str(bag)]) == 0
    assert main(["plot", str(bag)]) == 4
    err = capsys.readouterr().err
    assert "only imu/data (Imu)" in err
    assert f"lodeline replay {bag}" in err
    assert main(["plot", str(text)]) == 1
    assert main(["plot", str(tmp_path)]) == 4
    assert "holds no table" in capsys.readouterr().err


def test_the_gate_shown_is_the_one_of_the_run(loop: Path, tmp_path: Path) -> None:
    out = tmp_path / "strict.mcap"
    line = ["replay", str(loop), "--pipeline", "magnet-lab", "--set", "ekf.gate=4", "-o", str(out)]
    assert main(line) == 0
    (limit,) = made(out)["mahalanobis"].panels[0].limits
    assert limit.value == 2.0


def test_without_matplotlib_it_says_what_to_install(
    rover: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, name, None)
    assert main(["plot", str(rover), "--png", str(tmp_path)]) == 1
    assert "pip install 'lodeline[plot]'" in capsys.readouterr().err
    assert main(["plot", str(rover), "--html", str(tmp_path / "page.html")]) == 0


def test_a_live_recording_says_by_which_parameters_it_was_made() -> None:
    """What `bag record` notes is read back as it was."""
    from lodeline.pipeline.load import load
    from lodeline.recording.localizer import noted, params_of
    from lodeline.recording.localizer import read as noted_params

    pipeline = load(ROOT / "pipeline.yaml", ["ekf.bar_x=0.07", "ekf.initial_pose=[1, 2, 3]"])
    params = noted_params(noted(pipeline))
    assert params is not None
    assert params == params_of(pipeline)
    assert (params.bar_x, params.initial_pose) == (0.07, (1, 2, 3))
    assert noted_params({}) is None
    assert noted_params({"localizer": '{"gate": -1}'}) is None
