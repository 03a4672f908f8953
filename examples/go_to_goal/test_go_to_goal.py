"""What the node is claimed to do: without zenoh, without processes, in milliseconds."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from pathlib import Path

from lodeline.graph import Graph
from lodeline.loading import load_node
from lodeline_msgs import Message, PoseEstimate, Twist

NODE = load_node(Path(__file__).with_name("go_to_goal.py"))
COVARIANCE = (1e-5, 0.0, 0.0, 0.0, 1e-5, 0.0, 0.0, 0.0, 1e-3)


def commands(*poses: PoseEstimate) -> list[Twist]:
    """What the node sends when it is given these poses."""
    sent: list[Message] = []
    ports = {"goal": {"pose": "pose"}}, {"goal": {"cmd_vel": "cmd_vel"}}
    graph = Graph({"goal": NODE(NODE.params_type()())}, *ports)
    graph.tap("cmd_vel", sent.append)
    for pose in poses:
        graph.deliver("pose", pose)
    return [message for message in sent if isinstance(message, Twist)]


def pose(x: float, y: float, yaw: float) -> PoseEstimate:
    return PoseEstimate(1_000_000_000, x, y, yaw, COVARIANCE, 1.0, 0, False)


def test_it_turns_the_shorter_way_and_drives_only_when_it_looks_there() -> None:
    (left,) = commands(pose(0.3, 0.0, -0.1))  # the goal is north
    (right,) = commands(pose(0.0, 0.2, 2.0))  # the goal is east, behind its right shoulder
    assert left.w > 0.0 > right.w
    assert left.v == right.v == 0.0
    (ahead,) = commands(pose(0.0, 0.2, 0.0))
    assert ahead.v == 0.12
    assert ahead.w == 0.0


def test_it_stops_at_the_goal() -> None:
    assert commands(pose(0.305, 0.195, 1.0)) == [Twist(1_000_000_000, v=0.0, w=0.0)]
    assert commands(pose(0.311, 0.2, 1.0)) != [Twist(1_000_000_000, v=0.0, w=0.0)]


def test_a_robot_that_obeys_it_arrives() -> None:
    x, y, yaw, dt = 0.0, 0.0, pi, 0.05
    for _ in range(400):
        (command,) = commands(pose(x, y, yaw))
        x += dt * command.v * cos(yaw)
        y += dt * command.v * sin(yaw)
        yaw += dt * command.w
    assert hypot(x - 0.3, y - 0.2) < 0.01
