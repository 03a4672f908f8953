"""Claims about playing a recording into live processes: the pose ends where replay says."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from lodeline.sessions import Client
from lodeline_msgs import PoseEstimate, unpack
from tests.support.live import ROOT, Up, eventually, lodeline

pytestmark = pytest.mark.paired  # waits for a recording to be over

LOOP = ROOT / "tests" / "data" / "recordings" / "loop.txt"
TRUTH = LOOP.with_name("loop_truth.csv")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("loop")
    output = folder / "loop.mcap"
    result = lodeline(
        "bag", "import", str(LOOP), "--format", "magnet-lab", "-o", str(output), run=folder
    )
    assert result.returncode == 0, result.stderr
    return output


@pytest.fixture(scope="module")
def replayed(recording: Path) -> list[dict[str, float]]:
    """Rows of pose.csv."""
    tables = recording.parent / "csv"
    result = lodeline(
        "replay", str(recording), "--pipeline", "magnet-lab", "--csv", str(tables), run=tables
    )
    assert result.returncode == 0, result.stderr
    with (tables / "pose.csv").open() as lines:
        return [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(lines)]


def test_replay_of_the_simulated_lab_robot_stays_with_its_truth(
    replayed: list[dict[str, float]],
) -> None:
    with TRUTH.open() as lines:
        truth = {row["t_s"]: row for row in csv.DictReader(lines)}
    squares = []
    for pose in replayed:
        true = truth[f"{pose['stamp']:.6f}"]
        x, y = float(true["x_mm"]) * 1e-3, float(true["y_mm"]) * 1e-3
        squares.append((pose["x"] - x) ** 2 + (pose["y"] - y) ** 2)
    assert len(squares) == len(truth)
    assert math.sqrt(sum(squares) / len(squares)) < 0.004


def test_live_play_ends_within_two_millimetres_of_the_replay(
    recording: Path, replayed: list[dict[str, float]]
) -> None:
    poses: list[PoseEstimate] = []
    last = round(replayed[-1]["stamp"] * 1e9)
    with Up("magnet-lab") as up:
        client = Client(up.folder)
        client.subscribe(
            "magnet-lab/pose", 4096, lambda _k, data, _e: poses.append(unpack(data, PoseEstimate))
        )
        result = up.call("bag", "play", str(recording), "--rate", "10")
        assert result.returncode == 0, result.stderr
        assert eventually(lambda: bool(poses) and abs(poses[-1].stamp - last) < 1_000_000)
        again = up.call("bag", "play", str(recording))
        client.close()
    end = replayed[-1]
    assert math.hypot(poses[-1].x - end["x"], poses[-1].y - end["y"]) < 0.002
    assert abs(math.remainder(poses[-1].yaw - end["yaw"], math.tau)) < math.radians(0.5)
    assert again.returncode == 1
    assert "has played a recording already" in again.stderr


def test_play_into_a_pipeline_with_a_driver_on_the_key_is_refused(recording: Path) -> None:
    with Up(ROOT / "pipeline.yaml") as up:
        result = up.call("bag", "play", str(recording))
    assert result.returncode == 1
    assert "wheels comes from its node encoders already" in result.stderr


def test_play_without_a_pipeline_says_so(recording: Path, tmp_path: Path) -> None:
    result = lodeline("bag", "play", str(recording), run=tmp_path)
    assert result.returncode == 4
    assert "lodeline up" in result.stderr
