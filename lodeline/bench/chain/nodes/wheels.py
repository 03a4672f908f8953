"""Wheels that turn by one tick with each attitude: they join the IMU to the odometry."""

from __future__ import annotations

from dataclasses import dataclass

from lodeline.node import Input, Node, Output
from lodeline_msgs import AttitudeEstimate, WheelTicks


@dataclass(frozen=True, slots=True)
class WheelsParams:
    """None."""


class Wheels(Node[WheelsParams]):
    """The sensor's stamp goes through, so the age of the pose is the age of the IMU's reading."""

    attitude = Input(AttitudeEstimate, queue=256)
    wheels = Output(WheelTicks)

    def setup(self) -> None:
        self.ticks = 0

    @attitude.handler
    def on_attitude(self, attitude: AttitudeEstimate) -> None:
        self.ticks += 1
        self.wheels.send(WheelTicks(attitude.stamp, self.ticks, self.ticks))


if __name__ == "__main__":
    from lodeline.process import run

    run(Wheels)
