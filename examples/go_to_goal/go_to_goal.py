"""Go to goal: drives the robot to a point of the map, and stops there."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, remainder
from typing import Annotated

from lodeline.node import Input, Node, Output
from lodeline_msgs import PoseEstimate, Twist


def steer(x: float, y: float, yaw: float, goal: tuple[float, float]) -> tuple[float, float]:
    """Forward speed [m/s] and yaw rate [rad/s] from a pose [m, m, rad] towards a goal [m]."""
    east, north = goal[0] - x, goal[1] - y
    error = remainder(atan2(north, east) - yaw, 2.0 * pi)
    speed = min(0.12, hypot(east, north)) * max(0.0, cos(error))
    return speed, max(-0.8, min(0.8, 1.5 * error))


@dataclass(frozen=True, slots=True)
class GoalParams:
    """Where to go, and how near is near enough."""

    goal: Annotated[tuple[float, float], "m"] = (0.3, 0.2)
    reached: Annotated[float, "m"] = 0.01


class GoToGoal(Node[GoalParams]):
    """`pose` in, `cmd_vel` out, one for one."""

    pose = Input(PoseEstimate, queue=1, max_age=0.5)
    cmd_vel = Output(Twist)

    @pose.handler
    def on_pose(self, pose: PoseEstimate) -> None:
        goal = self.params.goal
        there = hypot(goal[0] - pose.x, goal[1] - pose.y) < self.params.reached
        v, w = (0.0, 0.0) if there else steer(pose.x, pose.y, pose.yaw, goal)
        self.cmd_vel.send(Twist(pose.stamp, v=v, w=w))


if __name__ == "__main__":
    from lodeline.process import run

    run(GoToGoal)
