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
class Mistake:
    """A way in which people get it wrong: functions as they write them, and what to tell them."""

    parts: dict[str, Callable[..., Any]]
    hint: str


@dataclass(frozen=True, slots=True)
class Exercise:
    """`inputs` are the node's ports and the keys of the default pipeline that they read."""

    name: str
    title: str
    inputs: dict[str, str]
    output: str
    quantities: tuple[Quantity, ...]
    mistakes: tuple[Mistake, ...]

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


EXERCISES = {
    exercise.name: exercise
    for exercise in (
        Exercise(
            "odometry",
            "where the wheels went: counts of two encoders to a pose",
            {"wheels": "wheels"},
            "odom",
            _pose(1e-7),
            tuple(Mistake({"travel": wrong}, hint) for wrong, hint in mistakes.TRAVEL),
        ),
        Exercise(
            "heading",
            "a compass: two readings of a magnetometer to a heading",
            {"mag": "imu/mag_raw"},
            "attitude",
            (Quantity("yaw", "rad", 1e-6, _yaw, angle=True),),
            tuple(Mistake({"heading": wrong}, hint) for wrong, hint in mistakes.HEADING),
        ),
        Exercise(
            "measurement",
            "the measurement equation: what an EKF expects to see of a magnet",
            {"odom": "odom", "magnets": "magnets"},
            "pose",
            _pose(1e-6),
            (
                *(Mistake({"expected": wrong}, hint) for wrong, hint in mistakes.EXPECTED),
                *(
                    Mistake({"expected": wrong, "jacobian": mistakes.right_jacobian}, hint)
                    for wrong, hint in mistakes.EXPECTED
                ),
                *(Mistake({"jacobian": wrong}, hint) for wrong, hint in mistakes.JACOBIAN),
            ),
        ),
    )
}
