"""All kinds of plots, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.plotting import NothingToPlotError, honesty, magnets, motion
from lodeline.plotting.figure import Figure
from lodeline.plotting.run import Run

KINDS: dict[str, Callable[[Run], Figure]] = {
    "path": motion.path,
    "yaw": motion.yaw,
    "speed": motion.speed,
    "yaw_rate": motion.yaw_rate,
    "attitude": motion.attitude,
    "gyro_bias": honesty.gyro_bias,
    "heading_std": honesty.heading_std,
    "sigmas": honesty.sigmas,
    "reeds": magnets.reeds,
    "mahalanobis": magnets.mahalanobis,
    "nis": magnets.nis,
    "errors": honesty.errors,
    "nees": honesty.nees,
}


def figures(run: Run) -> tuple[list[Figure], dict[str, str]]:
    """Every plot that the recording has the samples for; of the others, why it has not."""
    made: list[Figure] = []
    left_out: dict[str, str] = {}
    for kind, make in KINDS.items():
        try:
            made.append(make(run))
        except NothingToPlotError as error:
            left_out[kind] = str(error)
    return made, left_out
