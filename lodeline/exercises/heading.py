"""Exercise: a compass. Write `heading`; `lodeline grade heading FILE` looks at it."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, pi, sin
from typing import Annotated

from lodeline.node import Input, Node, Output
from lodeline_msgs import AttitudeEstimate, MagneticField

NOT_ASKED = (0.0, 0.0, 0.0)


def heading(x: float, y: float, low: tuple[float, float], high: tuple[float, float]) -> float:
    """Yaw [rad] of a robot that stands level: 0 is east, counter-clockwise is positive.

    The magnetometer reads `x` forward and `y` to the left [T]. While the robot turned once, its
    readings went from `low` to `high` [T], both (x, y): what is the same in all directions is iron
    on the robot, and half of what is between them is the earth's field. It points north.
    """
    # solution
    scaled_x = (2.0 * x - high[0] - low[0]) / (high[0] - low[0])
    scaled_y = (2.0 * y - high[1] - low[1]) / (high[1] - low[1])
    return 0.5 * pi - atan2(scaled_y, scaled_x)
    # blank: return 0.0


@dataclass(frozen=True, slots=True)
class TurnParams:
    """What the magnetometer of the simulated robot reads in a full turn."""

    low: Annotated[tuple[float, float], "T"] = (-11.1e-6, -21.3e-6)
    high: Annotated[tuple[float, float], "T"] = (34.1e-6, 19.3e-6)


class HeadingExercise(Node[TurnParams]):
    """`mag` in, `attitude` out."""

    mag = Input(MagneticField, queue=64)
    attitude = Output(AttitudeEstimate)

    @mag.handler
    def on_mag(self, sample: MagneticField) -> None:
        x, y, _ = sample.magnetic_field
        yaw = heading(x, y, self.params.low, self.params.high)
        self.attitude.send(
            AttitudeEstimate(
                stamp=sample.stamp,
                orientation=(0.0, 0.0, sin(0.5 * yaw), cos(0.5 * yaw)),
                angular_velocity=NOT_ASKED,
                gyro_bias=NOT_ASKED,
                heading_std=0.1,
                disturbed=False,
            )
        )


if __name__ == "__main__":
    from lodeline.process import run

    run(HeadingExercise)
