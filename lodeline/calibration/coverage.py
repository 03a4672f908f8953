"""How far a calibration has come while its readings come in: turns, sides, rest.

Nothing here decides on a calibration, the fits do; this is for the person who turns the robot.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import atan2, degrees, floor, hypot, pi, sqrt
from typing import TYPE_CHECKING, Any

from lodeline.calibration.apply import Calibrator, ImuCalibration
from lodeline.calibration.compass import SECTORS, CompassFit
from lodeline.calibration.conic import FAR, fit_quadric
from lodeline.calibration.quality import CalibrationRefusedError
from lodeline.calibration.still import GRAVITY, LEAST_LEAN
from lodeline.rotation import Vector, wrap_angle

if TYPE_CHECKING:
    from numpy.typing import NDArray

Point = tuple[float, float]

TURNS = 2.0
"""Whole turns that are asked for: what one of them has seen, the other one checks."""
SIDES = ("x up", "x down", "y up", "y down", "z up", "z down")
ARC = 4.0  # [rad] from which on the curve is taken for the ellipse that it is
MOST = 1500  # readings that a guess at the centre needs
SHOWN = 96  # points of a picture


@dataclass(frozen=True, slots=True)
class Turned:
    """`passes` counts for each of SECTORS directions how often the field went through it."""

    passes: tuple[int, ...]
    turns: float


@dataclass(frozen=True, slots=True)
class Picture:
    """Horizontal field before and after a calibration [T], and the circle that it should be.

    `centre` is where the middle of that circle was before. Errors of the heading [rad]: `was` is
    the RMS that the calibration before had left, measured by the new one, `left` what this leaves.
    """

    before: tuple[Point, ...]
    after: tuple[Point, ...]
    centre: Point
    radius: float
    was: float
    left: float

    @property
    def words(self) -> str:
        """One line for people."""
        return (
            f"before: circle {hypot(*self.centre) * 1e6:.1f} uT off its centre, heading wrong by"
            f" {degrees(self.was):.1f} deg; after: by about {max(0.1, degrees(self.left)):.1f} deg"
        )


def turned(fields: Sequence[Vector]) -> Turned:
    """How far the horizontal field (chip x and y) has gone round, readings (n, 3) in any unit.

    Where it starts does not matter, nor the way round; going back does not count twice.
    """
    import numpy as np

    if len(fields) < 3:
        return Turned((0,) * SECTORS, 0.0)
    points = np.asarray(fields[:: 1 + len(fields) // MOST], dtype=float)[:, :2]
    distances = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    points = points[distances <= FAR * np.median(distances)]  # a spike is no turn
    way = _way(_about_circle(points))
    if np.ptp(way) > ARC:  # before, an ellipse makes of noise what it likes
        with suppress(CalibrationRefusedError):
            quadric = fit_quadric(points)
            good = quadric.weights > 0.0
            way = _way((points[good] - quadric.centre) @ quadric.shape)
    first, last = (floor(float(v) / (2.0 * pi) * SECTORS) for v in (way.min(), way.max()))
    passes = [0] * SECTORS
    for step in range(first, last + 1):
        passes[step % SECTORS] += 1
    return Turned(tuple(passes), float(way.max() - way.min()) / (2.0 * pi))


def _way(centred: "NDArray[Any]") -> "NDArray[Any]":
    """Directions [rad] of points (n, 2) about their centre, as the robot turns, without jumps."""
    import numpy as np

    way: NDArray[Any] = np.unwrap(-np.arctan2(centred[:, 1], centred[:, 0]))
    return way


def _about_circle(points: "NDArray[Any]") -> "NDArray[Any]":
    """Points (n, 2) about the centre of the circle that fits them best (algebraically)."""
    import numpy as np

    q = points - points.mean(axis=0)
    design = np.column_stack([q, np.ones(len(q))])
    found = np.linalg.lstsq(design, (q * q).sum(axis=1), rcond=None)[0]
    centred: NDArray[Any] = q - found[:2] / 2.0
    return centred


def sides(positions: Sequence[Vector]) -> tuple[bool, ...]:
    """Which of SIDES a sensor has lain on, from its means at rest [m/s^2] (n, 3)."""
    lean = LEAST_LEAN * GRAVITY
    return tuple(
        any(sign * position[axis] > lean for position in positions)
        for axis in range(3)
        for sign in (1.0, -1.0)
    )


def picture(fields: Sequence[Vector], before: ImuCalibration, fit: CompassFit) -> Picture:
    """The readings [T] as the compass saw them and as it will see them, in chip axes."""
    old = Calibrator(ImuCalibration(mag_offset=before.mag_offset, mag_matrix=before.mag_matrix))
    new = Calibrator(ImuCalibration(mag_offset=fit.offset, mag_matrix=fit.matrix))
    thinned = fields[:: 1 + len(fields) // MOST]
    pairs = [(old.magnetic_field(field), new.magnetic_field(field)) for field in thinned]
    errors = [atan2(a[1], a[0]) - atan2(b[1], b[0]) for a, b in pairs]
    shown = pairs[:: 1 + len(pairs) // SHOWN]
    x, y, _ = old.magnetic_field(fit.offset)
    return Picture(
        tuple(a[:2] for a, _ in shown),
        tuple(b[:2] for _, b in shown),
        (x, y),
        fit.strength,
        _spread(errors),
        fit.misfit,
    )


def _spread(angles: Sequence[float]) -> float:
    """RMS of angles [rad] about their circular mean: a turn common to all is the mounting's."""
    from cmath import phase, rect

    mean = phase(sum(rect(1.0, angle) for angle in angles))
    return sqrt(sum(wrap_angle(angle - mean) ** 2 for angle in angles) / len(angles))
