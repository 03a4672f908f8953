"""Claims about the soak's own figures: a leak is seen, a restart is none, a wrong pose is."""

from __future__ import annotations

import pytest

from lodeline.bench.rig import position_errors
from lodeline.bench.soak import ERROR_M, CalmPoses, Record, calm_poses, slope, verdict
from lodeline_msgs import Odometry, PoseEstimate

NOTHING = (0.0,) * 9


def grown(per_minute: float, seconds: int = 300, start: float = 0.0) -> list[tuple[float, int]]:
    """Memory that jumps in the first two minutes of a process, and grows evenly after them."""
    return [
        (start + t, round(33e6 * (1.0 + per_minute * (t - 120) / 60.0)) if t >= 120 else 30_000_000)
        for t in range(seconds)
    ]


def test_growth_within_lives_is_a_leak_and_a_fresh_process_is_none() -> None:
    assert slope(Record(memory={1: grown(0.05)})) == pytest.approx(0.05, rel=0.01)
    steady = Record(memory={1: grown(0.0), 2: grown(0.0, start=300.0)})
    assert slope(steady) == pytest.approx(0.0, abs=1e-6)
    assert slope(Record(memory={1: grown(0.5, seconds=170)})) is None


def pose(stamp: int, x: float, y: float = 0.0) -> tuple[float, PoseEstimate]:
    return stamp * 1e-9, PoseEstimate(stamp, x, y, 0.0, NOTHING, 0.0, 0, False)


def truth(stamp: int, x: float) -> tuple[float, Odometry]:
    return stamp * 1e-9, Odometry(stamp, x, 0.0, 0.0, 0.0, 0.0, NOTHING, (0.0,) * 4, 0.0)


def test_a_pose_is_measured_against_the_truth_of_its_own_moment() -> None:
    step = 20_000_000
    truths = [truth(i * step, 0.01 * i) for i in range(100)]
    poses = [pose(i * step + step // 2, 0.01 * i + 0.005, 0.002) for i in range(0, 90, 3)]
    errors = position_errors(poses, truths)
    assert len(errors) == len(poses)
    assert all(error == pytest.approx(0.002) for _, error in errors)


def test_where_the_truth_was_away_nothing_is_measured() -> None:
    truths = [truth(0, 0.0), truth(3_000_000_000, 1.0), truth(3_020_000_000, 1.0)]
    assert position_errors([pose(1_500_000_000, 9.0)], truths) == []


def test_a_doubt_has_a_reason_only_after_a_gap() -> None:
    errors = [(float(second), float(second)) for second in range(20)]
    doubted = {2.0, 8.0, 12.0, 18.0}
    found = calm_poses(errors, doubted, kills=[1.0, 10.0], gaps=[11.0, 15.0])
    assert found.unsure == [8.0, 18.0], "2 s and 12 s are less than 3 s after a kill"
    assert found.groundless == 1
    assert 13.0 not in found.sure
    assert 14.0 in found.sure
    assert calm_poses(errors, doubted, [], []).groundless == 4


def test_every_broken_bound_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    well = {"ekf": Record(kills=[1.0], back=[0.5], memory={1: grown(0.0)})}
    assert verdict(well, {"ekf": "running"}, CalmPoses([0.001] * 500, [0.1] * 90, 5)) == 0
    ill = {"ekf": Record(kills=[1.0, 2.0], back=[0.5], memory={1: grown(0.05)})}
    assert verdict(ill, {"ekf": "failed"}, CalmPoses([2 * ERROR_M] * 500, [], 9)) == 1
    said = capsys.readouterr().err
    for words in (
        "ekf is failed",
        "was not back within",
        "grows by 5.0",
        "ambiguous 9 times without a reason",
        "only 0.00% of the sure time",
    ):
        assert words in said
