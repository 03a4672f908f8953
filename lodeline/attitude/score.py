"""How far an orientation is from the truth: total, heading and inclination error.

The measure of the BROAD data set (Laidig, Caruso, Cereatti and Seel 2021): the error quaternion is
taken in the earth frame, so that its vertical part is the heading error.
"""

from collections.abc import Iterable
from math import acos, atan2, hypot, sqrt
from typing import NamedTuple

from lodeline.rotation import Quaternion, conjugate, multiply


class AttitudeError(NamedTuple):
    """Three angles [rad], none negative."""

    total: float
    heading: float
    inclination: float


def attitude_error(estimate: Quaternion, truth: Quaternion) -> AttitudeError:
    """The error of one orientation, both body to world (x, y, z, w) and of unit norm."""
    _, _, z, w = multiply(estimate, conjugate(truth))
    return AttitudeError(
        2.0 * acos(min(1.0, abs(w))),
        2.0 * atan2(abs(z), abs(w)),
        2.0 * acos(min(1.0, hypot(z, w))),
    )


def rms_error(pairs: Iterable[tuple[Quaternion, Quaternion]]) -> AttitudeError:
    """RMS [rad] of each angle over pairs (estimate, truth). ValueError without any pair."""
    errors = [attitude_error(estimate, truth) for estimate, truth in pairs]
    if not errors:
        raise ValueError("no pair to score")
    total, heading, inclination = (
        sqrt(sum(e[i] * e[i] for e in errors) / len(errors)) for i in range(3)
    )
    return AttitudeError(total, heading, inclination)
