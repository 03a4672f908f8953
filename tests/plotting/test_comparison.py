"""Claims about `lodeline compare`: a known offset is found, at whatever stamps it was sampled."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from lodeline.cli import main
from lodeline.recording.write import RecordingWriter
from lodeline.rotation import wrap_angle
from lodeline_msgs import Odometry, PoseEstimate

NONE9 = (1e-6, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-6)
NONE4 = (1e-6, 0.0, 0.0, 1e-6)


def straight(
    file: Path,
    rate: float,
    *,
    begin: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
    turn: float = 0.0,
    faster: float = 0.0,
    epoch: float = 1e6,
) -> Path:
    """Ten seconds of a way at constant speed that turns through north and south, sampled at `rate`
    from `begin` [s] on.
    """
    with file.open("wb") as stream:
        writer = RecordingWriter(stream, {})
        for i in range(int((10.0 - begin) * rate)):
            t = begin + i / rate
            stamp = round((epoch + t) * 1e9)
            x, y = 0.2 * t + offset[0], 0.1 * t + offset[1]
            yaw = wrap_angle(3.0 + 0.2 * t + turn)
            writer.write("pose", PoseEstimate(stamp, x, y, yaw, NONE9, 0.0, 0, False))
            odom = Odometry(stamp, x, y, yaw, 0.2 + faster, 0.2, NONE9, NONE4, 1.0 / rate)
            writer.write("odom", odom)
        writer.close()
    return file


def test_a_known_offset_is_what_it_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a = straight(tmp_path / "a.mcap", 20.0)
    b = straight(tmp_path / "b.mcap", 33.0, begin=2.013, offset=(3e-3, 4e-3), turn=0.1, faster=0.02)
    assert main(["compare", str(a), str(b), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    found = {name: each["rms"] for name, each in said["differences"].items()}
    assert found == {
        "position": pytest.approx(5e-3, abs=1e-9),
        "yaw": pytest.approx(0.1, abs=1e-9),
        "speed": pytest.approx(0.02, abs=1e-12),
    }
    assert said["differences"]["position"]["samples"] == pytest.approx(20.0 * 7.9, abs=3)
    assert said["seconds"] == pytest.approx(7.9, abs=0.2)
    assert main(["compare", str(a), str(b)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["position", "5.000", "5.000", "mm"] in [line[:4] for line in lines]
    assert ["yaw", "5.730", "5.730", "deg"] in [line[:4] for line in lines]


def test_runs_of_other_times_are_compared_from_their_beginnings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a = straight(tmp_path / "a.mcap", 20.0)
    b = straight(tmp_path / "b.mcap", 20.0, offset=(0.0, 0.01), epoch=2e6)
    assert main(["compare", str(a), str(b)]) == 4
    assert "--from-start" in capsys.readouterr().err
    assert main(["compare", str(a), str(b), "--from-start", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["differences"]["position"]["rms"] == pytest.approx(0.01, abs=1e-9)


def test_two_keys_of_one_run_are_compared_and_drawn(
    rover: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, pictures = tmp_path / "page.html", tmp_path / "png"
    line = ["compare", str(rover), str(rover), "--key", "pose", "--key", "odom", "--json"]
    assert main([*line, "--html", str(page), "--png", str(pictures)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["a"]["key"], said["b"]["key"]) == ("pose", "odom")
    apart = said["differences"]["position"]
    assert 0.0 < apart["rms"] < apart["largest"] < 0.05
    assert said["differences"]["speed"]["rms"] == 0.0
    names = {file.stem for file in pictures.iterdir()}
    assert names == {"path", "yaw", "speed", "differences"}
    assert page.stat().st_size > 50_000
    assert main(["compare", str(rover), str(rover), "--key", "podom"]) == 4
    assert "no pose on 'podom', but on pose, odom" in capsys.readouterr().err


def test_the_largest_difference_is_told_with_its_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two straight ways that part: at the end they are farthest."""
    a, b = tmp_path / "a.mcap", tmp_path / "b.mcap"
    for file, slope in ((a, 0.0), (b, 0.01)):
        with file.open("wb") as stream:
            writer = RecordingWriter(stream, {})
            for i in range(101):
                pose = PoseEstimate(i * 10**8, 0.1 * i, slope * i, 0.0, NONE9, 0.0, 0, False)
                writer.write("pose", pose)
            writer.close()
    assert main(["compare", str(a), str(b), "--json"]) == 0
    out, err = capsys.readouterr()
    position = json.loads(out)["differences"]["position"]
    assert position["largest"] == pytest.approx(1.0)
    assert position["at"] == pytest.approx(10.0)
    rms = math.sqrt(sum((0.01 * i) ** 2 for i in range(101)) / 101)
    assert position["rms"] == pytest.approx(rms, rel=1e-12)
    assert "left out speed" in err
