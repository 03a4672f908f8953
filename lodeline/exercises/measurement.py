"""Exercise: the measurement equation of an EKF. Write `expected` and `jacobian`.

The rest of the filter is here; `lodeline grade measurement FILE` looks at what you wrote.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Annotated

import numpy as np

from lodeline.node import Input, Node, Output
from lodeline_msgs import MagnetDetection, Odometry, PoseEstimate

Point = tuple[float, float]
Row = tuple[float, float, float]


def expected(x: float, y: float, yaw: float, magnet: Point) -> tuple[float, float]:
    """Where a magnet is seen from the robot: forward [m], left [m].

    The robot stands at `x`, `y` [m] with heading `yaw` [rad], the magnet at `magnet` [m]: all in
    the map, where yaw 0 looks along x and counter-clockwise is positive.
    """
    # solution
    east, north = magnet[0] - x, magnet[1] - y
    return cos(yaw) * east + sin(yaw) * north, cos(yaw) * north - sin(yaw) * east
    # blank: return 0.0, 0.0


def jacobian(x: float, y: float, yaw: float, magnet: Point) -> tuple[Row, Row]:
    """How `expected` changes with x, y and yaw: a row for forward, a row for left."""
    # solution
    forward, left = expected(x, y, yaw, magnet)
    return (-cos(yaw), -sin(yaw), left), (sin(yaw), -cos(yaw), -forward)
    # blank: return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class FilterParams:
    """Where the robot starts, the floor, and how far things are believed."""

    start_sigma: Annotated[tuple[float, float, float], "m, m, rad"] = (0.005, 0.005, 0.05)
    pitch: Annotated[float, "m"] = 0.055
    bar_x: Annotated[float, "m"] = 0.080
    way_noise: Annotated[float, "m/m^0.5"] = 0.02
    turn_noise: Annotated[float, "rad/m^0.5"] = 0.2
    bar_sigma: Annotated[tuple[float, float], "m, m"] = (0.006, 0.004)
    gate: Annotated[float, "1"] = 9.21  # 99 % of chi-square with two degrees of freedom


class MeasurementExercise(Node[FilterParams]):
    """`odom` moves the estimate, `magnets` correct it; `pose` after each."""

    odom = Input(Odometry, queue=64)
    magnets = Input(MagnetDetection, queue=64)
    pose = Output(PoseEstimate)

    def setup(self) -> None:
        self.state = np.zeros(3)
        self.P = np.diag(np.square(self.params.start_sigma))
        self.last: Odometry | None = None
        self.nis, self.rejected = 0.0, 0

    @odom.handler
    def on_odom(self, odom: Odometry) -> None:
        last, self.last = self.last, odom
        if last is None:
            return
        # The step in the robot's own axes, then turned into the map.
        dx, dy = odom.x - last.x, odom.y - last.y
        forward = cos(last.yaw) * dx + sin(last.yaw) * dy
        left = cos(last.yaw) * dy - sin(last.yaw) * dx
        c, s = cos(self.state[2]), sin(self.state[2])
        self.state += (c * forward - s * left, s * forward + c * left, odom.yaw - last.yaw)
        A = np.eye(3)
        A[:2, 2] = -s * forward - c * left, c * forward - s * left
        B = np.array([[c, 0.0], [s, 0.0], [0.0, 1.0]])
        Q = np.square([self.params.way_noise, self.params.turn_noise]) * abs(forward)
        self.P = A @ self.P @ A.T + B @ np.diag(Q) @ B.T
        self.send(odom.stamp)

    @magnets.handler
    def on_magnets(self, detection: MagnetDetection) -> None:
        for lateral in detection.lateral:
            self.update(np.array([self.params.bar_x, lateral]))
        if detection.lateral and self.last is not None:
            self.send(detection.stamp)

    def update(self, Y: np.ndarray) -> None:
        """One magnet seen at Y = (forward, left) [m] by the bar."""
        x, y, yaw = map(float, self.state)
        pitch = self.params.pitch
        seen = x + cos(yaw) * Y[0] - sin(yaw) * Y[1], y + sin(yaw) * Y[0] + cos(yaw) * Y[1]
        magnet = pitch * round(seen[0] / pitch), pitch * round(seen[1] / pitch)
        innovation = Y - expected(x, y, yaw, magnet)
        C = np.array(jacobian(x, y, yaw, magnet))
        S = C @ self.P @ C.T + np.diag(np.square(self.params.bar_sigma))
        self.nis = float(innovation @ np.linalg.solve(S, innovation))
        if self.nis > self.params.gate:
            self.rejected += 1
            return
        K = np.linalg.solve(S, C @ self.P).T
        self.state = self.state + K @ innovation
        self.P = (np.eye(3) - K @ C) @ self.P

    def send(self, stamp: int) -> None:
        x, y, yaw = map(float, self.state)
        self.pose.send(
            PoseEstimate(
                stamp=stamp,
                x=x,
                y=y,
                yaw=yaw,
                covariance=tuple(self.P.ravel().tolist()),
                nis=self.nis,
                rejected=self.rejected,
                ambiguous=False,
            )
        )


if __name__ == "__main__":
    from lodeline.process import run

    run(MeasurementExercise)
