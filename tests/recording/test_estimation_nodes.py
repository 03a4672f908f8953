"""Odometry, magnets and EKF as nodes: what goes in, what comes out, and what a restart costs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgpack
import pytest

from lodeline.graph import Graph
from lodeline.keepsake import rebuilt
from lodeline.loading import load_node, shipped
from lodeline.recording.magnet_lab import messages, read_rows
from lodeline_msgs import MagnetDetection, Message, Odometry, PoseEstimate, ReedBar, WheelTicks

INPUTS = {
    "odometry": {"wheels": "wheels"},
    "magnets": {"reeds": "reeds"},
    "ekf": {"odom": "odom", "magnets": "magnets"},
}
OUTPUTS = {"odometry": {"odom": "odom"}, "magnets": {"magnets": "magnets"}, "ekf": {"pose": "pose"}}


def node(name: str) -> Any:
    kind = load_node(shipped("nodes") / f"{name}.py")
    return kind(kind.params_type()())


def chain(nodes: dict[str, Any], keys: tuple[str, ...]) -> tuple[Graph, list[Message]]:
    graph = Graph(nodes, INPUTS, OUTPUTS)
    out: list[Message] = []
    for key in keys:
        graph.tap(key, out.append)
    return graph, out


def test_odometry_answers_each_reading_with_its_stamp() -> None:
    graph, out = chain({"odometry": node("odometry")}, ("odom",))
    graph.deliver("wheels", WheelTicks(1_000_000_000, 100, 100))
    graph.deliver("wheels", WheelTicks(1_100_000_000, 136, 136))
    first, second = out
    assert isinstance(first, Odometry)
    assert isinstance(second, Odometry)
    assert (first.stamp, first.x, first.interval) == (1_000_000_000, 0.0, 0.0)
    assert second.stamp == 1_100_000_000
    assert second.x == pytest.approx(0.1 * 2 * 3.14159265 * 0.0215)  # a tenth of a turn
    assert second.v == pytest.approx(second.x / 0.1)
    assert second.twist_covariance[0] > 0.0


def test_reading_whose_time_stands_still_is_counted_and_sends_nothing() -> None:
    odometry = node("odometry")
    graph, out = chain({"odometry": odometry}, ("odom",))
    for _ in range(3):
        graph.deliver("wheels", WheelTicks(1_000_000_000, 100, 100))
    assert len(out) == 1
    assert odometry.context.rejected["time stands still"] == 2


def test_reed_bar_without_a_magnet_is_an_empty_detection() -> None:
    graph, out = chain({"magnets": node("magnets")}, ("magnets",))
    graph.deliver("reeds", ReedBar(5, 0))
    graph.deliver("reeds", ReedBar(6, 0b10000001))
    nothing, two = out
    assert nothing == MagnetDetection(5, (), seq=0)
    assert isinstance(two, MagnetDetection)
    assert (two.stamp, two.seq) == (6, 1)
    assert two.lateral == pytest.approx((-0.035, 0.035))


def test_each_row_gives_one_pose_at_its_stamp_with_its_magnets_in_it(lab_text: Path) -> None:
    graph, out = chain({name: node(name) for name in INPUTS}, ("pose",))
    rows = read_rows(lab_text)
    for key, message in messages(rows):
        graph.deliver(key, message)
    assert [pose.stamp for pose in out] == [row.stamp for row in rows]
    assert [pose.seq for pose in out] == list(range(len(rows)))
    assert any(pose.nis > 0.0 for pose in out if isinstance(pose, PoseEstimate))


def test_magnet_that_comes_after_its_odometry_corrects_the_pose_at_once(lab_text: Path) -> None:
    graph, out = chain({name: node(name) for name in INPUTS}, ("pose",))
    rows = read_rows(lab_text)
    hits = 0
    for reeds, wheels in zip(*[iter(messages(rows))] * 2, strict=True):
        before = len(out)
        graph.deliver(*wheels)
        graph.deliver(*reeds)
        assert isinstance(reeds[1], ReedBar)
        hit = reeds[1].closed > 0
        hits += hit
        assert len(out) == before + 1 + hit
    assert hits > 20


def restarted(nodes: dict[str, Any]) -> dict[str, Any]:
    """Successors of these nodes, with their states gone through a file and back."""
    made = {name: node(name) for name in nodes}
    for name, old in nodes.items():
        state = old.save()
        if state is not None:
            values = msgpack.unpackb(msgpack.packb(asdict(state)), use_list=False)
            made[name].resume(rebuilt(values, type(old).State))
    return made


def final_pose(rows: list[Any], restart_at: int | None) -> PoseEstimate:
    nodes = {name: node(name) for name in INPUTS}
    graph, out = chain(nodes, ("pose",))
    for i, row in enumerate(rows):
        if i == restart_at:
            nodes = restarted(nodes)
            graph, out = chain(nodes, ("pose",))
        for key, message in messages([row]):
            graph.deliver(key, message)
    pose = out[-1]
    assert isinstance(pose, PoseEstimate)
    return pose


@pytest.mark.parametrize("restart_at", [1, 50, 173, 300])
def test_nodes_restarted_in_mid_run_end_where_they_would_have_ended(
    restart_at: int, lab_text: Path
) -> None:
    rows = read_rows(lab_text)
    through, resumed = final_pose(rows, None), final_pose(rows, restart_at)
    assert abs(resumed.x - through.x) < 1e-9
    assert abs(resumed.y - through.y) < 1e-9
    assert abs(resumed.yaw - through.yaw) < 1e-9
    assert resumed.rejected == through.rejected
