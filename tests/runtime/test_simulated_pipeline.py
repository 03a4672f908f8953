"""Claims about the default pipeline in simulated time: the same run on every machine."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest

from lodeline import virtual
from lodeline.pipeline.load import load
from lodeline_msgs import Message, Odometry, PoseEstimate
from tests.support.live import ROOT
from tests.support.truth import heading_errors

SECONDS = 40.0


def run(seconds: float, *settings: str) -> dict[str, list[Message]]:
    """All that is sent on each key."""
    sent: dict[str, list[Message]] = {}
    with tempfile.TemporaryDirectory(prefix="ll") as folder:
        virtual.run(
            load(ROOT / "pipeline.yaml", settings),
            seconds,
            Path(folder),
            lambda key, message: sent.setdefault(key.partition("/")[2], []).append(message),
        )
    return sent


@pytest.fixture(scope="module")
def sent() -> dict[str, list[Message]]:
    return run(SECONDS)


def truth_by_stamp(sent: dict[str, list[Message]]) -> dict[int, Odometry]:
    return {m.stamp: m for m in sent["truth"] if isinstance(m, Odometry)}


def errors(estimates: Sequence[Message], truth: dict[int, Odometry]) -> list[float]:
    """Distances [m] from the truth, where there is one of the same stamp."""
    return [
        math.hypot(m.x - truth[m.stamp].x, m.y - truth[m.stamp].y)
        for m in estimates
        if isinstance(m, PoseEstimate | Odometry) and m.stamp in truth
    ]


def test_the_pose_stays_within_millimetres_while_odometry_drifts(
    sent: dict[str, list[Message]],
) -> None:
    truth = truth_by_stamp(sent)
    pose, odometry = errors(sent["pose"], truth), errors(sent["odom"], truth)
    assert math.sqrt(sum(e * e for e in pose) / len(pose)) < 0.003
    assert max(pose) < 0.010
    assert max(odometry) > 0.030


def test_the_pose_is_sure_of_its_cell_nearly_always(sent: dict[str, list[Message]]) -> None:
    poses = [m for m in sent["pose"] if isinstance(m, PoseEstimate)]
    assert sum(m.ambiguous for m in poses) < 0.02 * len(poses)
    assert poses[-1].rejected <= 0.01 * len(poses)


def test_errors_are_as_large_as_the_covariance_says(sent: dict[str, list[Message]]) -> None:
    truth = truth_by_stamp(sent)
    poses = [m for m in sent["pose"] if isinstance(m, PoseEstimate) and m.stamp in truth]
    outside = sum(
        abs(m.x - truth[m.stamp].x) > 3.0 * math.sqrt(m.covariance[0])
        or abs(m.y - truth[m.stamp].y) > 3.0 * math.sqrt(m.covariance[4])
        for m in poses
    )
    assert outside <= 0.01 * len(poses)
    nees = sum(
        (m.x - truth[m.stamp].x) ** 2 / m.covariance[0]
        + (m.y - truth[m.stamp].y) ** 2 / m.covariance[4]
        for m in poses
    )
    assert nees / len(poses) > 0.3, "2 for errors as large as said: it is not more unsure than that"


def test_odometry_never_announces_a_jump(sent: dict[str, list[Message]]) -> None:
    assert {m.resets for m in sent["odom"] if isinstance(m, Odometry)} == {0}


def test_heading_stays_on_magnetic_north(sent: dict[str, list[Message]]) -> None:
    off = heading_errors(sent["attitude"], sent["truth"])
    assert len(off) > 100 * SECONDS
    assert math.sqrt(sum(e * e for e in off) / len(off)) < math.radians(1.0)


def test_two_runs_send_the_same_messages(sent: dict[str, list[Message]]) -> None:
    again = run(5.0)
    for key, messages in again.items():
        assert messages == sent[key][: len(messages)], key


def test_another_seed_is_another_run(sent: dict[str, list[Message]]) -> None:
    other = run(5.0, "simulator.robot.seed=2")
    assert other["truth"] != sent["truth"][: len(other["truth"])]
