"""Counts of a Beego's two motors. Yours to change: it stands in for the motor controller.

In the simulation it counts what the robot truly does. On the robot take out the input `truth`,
make this a Driver with a `rate` among its params (nodes/encoders.py is one), and read both
counters of the controller in `tick(stamp)`: cumulative, forward positive. `counter_bits` of the
odometry takes care of counters that roll over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Input, Node, Output
from lodeline.odometry.kinematics import DifferentialDrive
from lodeline.stamps import Steps
from lodeline_msgs import Odometry, WheelTicks


@dataclass(frozen=True, slots=True)
class CountersParams:
    """The wheels, and how often a motor's encoder counts while its wheel turns once."""

    wheel_radius: Annotated[float, "m"] = 0.0406
    track: Annotated[float, "m"] = 0.2765
    ticks_per_turn: Annotated[float, "1"] = 2048.0
    gear: Annotated[float, "1"] = 54.0699


class Counters(Node[CountersParams]):
    """`truth` in, `wheels` out, one for one."""

    truth = Input(Odometry, queue=64)
    wheels = Output(WheelTicks)

    def setup(self) -> None:
        p = self.params
        self.drive = DifferentialDrive(p.wheel_radius, p.track, p.ticks_per_turn, p.gear)
        self.steps = Steps()
        self.left = self.right = 0.0

    @truth.handler
    def on_truth(self, truth: Odometry) -> None:
        dt = self.steps.take(truth.stamp)
        if dt is None:
            return
        left, right = self.drive.wheels(truth.v * dt, truth.w * dt)
        self.left += left / self.drive.metres_per_tick
        self.right += right / self.drive.metres_per_tick
        self.wheels.send(WheelTicks(truth.stamp, round(self.left), round(self.right)))


if __name__ == "__main__":
    from lodeline.process import run

    run(Counters)
