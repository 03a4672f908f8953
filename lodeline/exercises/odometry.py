"""Exercise: where the wheels went. Write `travel`; `lodeline grade odometry FILE` looks at it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Annotated

from lodeline.node import Input, Node, Output
from lodeline_msgs import Odometry, WheelTicks

NOT_ASKED = (0.0,) * 9


def travel(left: float, right: float, track: float, yaw: float) -> tuple[float, float, float]:
    """How far the robot went in one step: east [m], north [m], and its turn [rad].

    `left` and `right` [m] are the ways of the two wheels, `track` [m] their distance, `yaw` [rad]
    the heading before the step: 0 is east, counter-clockwise is positive. The step counts as
    straight, in the direction that the robot had half way through its turn.
    """
    # solution
    way, turn = 0.5 * (left + right), (right - left) / track
    middle = yaw + 0.5 * turn
    return way * cos(middle), way * sin(middle), turn
    # blank: return 0.0, 0.0, 0.0


@dataclass(frozen=True, slots=True)
class WheelParams:
    """The robot, as in pipeline.yaml."""

    wheel_radius: Annotated[float, "m"] = 0.0215
    track: Annotated[float, "m"] = 0.112
    ticks_per_turn: Annotated[int, "1"] = 16384


class OdometryExercise(Node[WheelParams]):
    """`wheels` in, `odom` out; the first counts are where the robot starts."""

    wheels = Input(WheelTicks, queue=64)
    odom = Output(Odometry)

    def setup(self) -> None:
        self.x = self.y = self.yaw = 0.0
        self.last: WheelTicks | None = None

    @wheels.handler
    def on_wheels(self, ticks: WheelTicks) -> None:
        params, last, self.last = self.params, self.last, ticks
        if last is None:
            return
        metres = 2.0 * pi * params.wheel_radius / params.ticks_per_turn
        left, right = metres * (ticks.left - last.left), metres * (ticks.right - last.right)
        east, north, turn = travel(left, right, params.track, self.yaw)
        self.x, self.y, self.yaw = self.x + east, self.y + north, self.yaw + turn
        dt = (ticks.stamp - last.stamp) * 1e-9
        self.odom.send(
            Odometry(
                stamp=ticks.stamp,
                x=self.x,
                y=self.y,
                yaw=self.yaw,
                v=0.5 * (left + right) / dt,
                w=turn / dt,
                pose_covariance=NOT_ASKED,
                twist_covariance=NOT_ASKED[:4],
                interval=dt,
            )
        )


if __name__ == "__main__":
    from lodeline.process import run

    run(OdometryExercise)
