"""A robot that costs next to nothing: readings of an IMU at rest, and every second time a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline_msgs import Imu, Odometry

POSE, TWIST = (1e-4,) * 9, (1e-4,) * 4  # covariances


@dataclass(frozen=True, slots=True)
class LightRobotParams:
    """How often the IMU is read."""

    rate: Annotated[float, "Hz"] = 200.0


class LightRobot(Driver[LightRobotParams]):
    """Sends what several robots on one machine would send, had each a machine of its own."""

    data_raw = Output(Imu)
    odom = Output(Odometry)

    def setup(self) -> None:
        self.odd = False

    def tick(self, stamp: int) -> None:
        self.data_raw.send(Imu(stamp, (0.001, -0.002, 0.1), (0.02, -0.01, 9.81)))
        self.odd = not self.odd
        if self.odd:
            self.odom.send(Odometry(stamp, 1.0, 2.0, 0.5, 0.1, 0.2, POSE, TWIST, 0.01))


if __name__ == "__main__":
    from lodeline.process import run

    run(LightRobot)
