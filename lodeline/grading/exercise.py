"""What can be exercised: the node of each exercise, what it reads, and how its answer is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lodeline.grading import mistakes
from lodeline.loading import shipped
from lodeline.rotation import yaw_of
from lodeline_msgs import AttitudeEstimate


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of the answer: how to get it from a message, its unit, and how exact it must be."""

    name: str
    unit: str
    tolerance: float
    of: Callable[[Any], float]
    angle: bool = False


@dataclass(frozen=True, slots=True)
class Part:
    """A function to be written: arguments to try it with, and how people get it wrong.

    `angle`: what it returns is one, so that a whole turn more is the same.
    """

    name: str
    tries: tuple[tuple[Any, ...], ...]
    mistakes: tuple[mistakes.Wrong, ...]
    angle: bool = False


@dataclass(frozen=True, slots=True)
class Exercise:
    """`inputs` are the node's ports and the keys of the default pipeline that they read."""

    name: str
    title: str
    inputs: dict[str, str]
    output: str
    quantities: tuple[Quantity, ...]
    parts: tuple[Part, ...]

    @property
    def file(self) -> Path:
        """The node with the part to be written in it."""
        return shipped("exercises") / f"{self.name}.py"

    def blank(self) -> str:
        """The node without that part: what stands between `# solution` and `# blank: CODE`."""
        lines, hidden = [], False
        for line in self.file.read_text().splitlines():
            indent, mark, code = line.partition("# blank: ")
            if line.strip() == "# solution":
                hidden = True
            elif mark:
                hidden = False
                lines += [f"{indent}# Your part. Take this line away.", f"{indent}{code}"]
            elif not hidden:
                lines.append(line)
        return "\n".join(lines) + "\n"


def _pose(tolerance: float) -> tuple[Quantity, ...]:
    return (
        Quantity("x", "m", tolerance, lambda message: float(message.x)),
        Quantity("y", "m", tolerance, lambda message: float(message.y)),
        Quantity("yaw", "rad", tolerance, lambda message: float(message.yaw), angle=True),
    )


def _yaw(message: AttitudeEstimate) -> float:
    return yaw_of(message.orientation)


STEPS = ((0.02, 0.03, 0.1, 0.0), (0.03, 0.01, 0.2, 2.0), (0.01, 0.01, 0.1, -1.0))
"""left, right, track [m], yaw [rad]."""
READINGS = tuple(
    (x * 1e-6, y * 1e-6, (-10e-6, -30e-6), (30e-6, 10e-6 + stretch))
    for x, y, stretch in ((25.0, 5.0, 0.0), (-8.0, -5.0, 2e-6), (5.0, -25.0, 4e-6))
)
"""x, y, low, high [T]."""
PLACES = ((1.0, 2.0, 0.5, (1.1, 2.3)), (-0.2, 0.1, 2.5, (0.0, 0.0)))
"""x, y [m], yaw [rad], magnet [m]."""
EXERCISES = {
    exercise.name: exercise
    for exercise in (
        Exercise(
            "odometry",
            "where the wheels went: counts of two encoders to a pose",
            {"wheels": "wheels"},
            "odom",
            _pose(1e-7),
            (Part("travel", STEPS, mistakes.TRAVEL),),
        ),
        Exercise(
            "heading",
            "a compass: two readings of a magnetometer to a heading",
            {"mag": "imu/mag_raw"},
            "attitude",
            (Quantity("yaw", "rad", 1e-6, _yaw, angle=True),),
            (Part("heading", READINGS, mistakes.HEADING, angle=True),),
        ),
        Exercise(
            "measurement",
            "the measurement equation: what an EKF expects to see of a magnet",
            {"odom": "odom", "magnets": "magnets"},
            "pose",
            _pose(1e-6),
            (
                Part("expected", PLACES, mistakes.EXPECTED),
                Part("jacobian", PLACES, mistakes.JACOBIAN),
            ),
        ),
    )
}
