"""Magnetometer calibration from a recorded turn: a fitted ellipse (flat) or ellipsoid (all ways).

Hard iron moves the centre, soft iron bends the circle; both come out as the offset and matrix of
`ImuCalibration`. Readings are in chip axes, as they come; the fit refuses what would mislead.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, pi
from typing import TYPE_CHECKING, Any

from lodeline.calibration.apply import ImuCalibration
from lodeline.calibration.conic import Quadric, fit_quadric
from lodeline.calibration.minmax import MinMax
from lodeline.calibration.quality import CalibrationRefusedError, checked
from lodeline.rotation import Vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

_Nine = tuple[float, float, float, float, float, float, float, float, float]

LEAST_CHANGE = 0.1  # of readings, relative to their mean, and
LEAST_FIELD = 5e-6  # [T]: beside a strong magnet a whole turn changes them by little of their mean
LEAST_COVERAGE = 5.0 / 3.0 * pi  # [rad] 300 degrees
LEAST_SPREAD = 0.08  # smallest share of directions along any axis; a full sphere has 1/3
MOST_OUTLIERS = 0.1
LARGEST_RATIO = 2.0  # of the longest to the shortest axis; more is no iron of a robot
LARGEST_NOISE = 0.15  # of one reading, relative to the field
GOOD_MISFIT = 0.02
LARGEST_MISFIT = 0.07  # [rad] of what is left once noise is averaged out
SECTORS = 24
UNKNOWN = ImuCalibration()


@dataclass(frozen=True, slots=True)
class CompassFit:
    """A calibration of the magnetometer, and how good it is."""

    offset: Vector  # hard iron [T]
    matrix: _Nine  # soft iron, rows one after the other
    strength: float  # of the field [T]: horizontal after a flat turn, whole otherwise
    coverage: float  # [rad] of the turn that was seen; the whole sphere counts 2 pi
    noise: float  # standard deviation of one reading, relative to the field
    misfit: float  # [rad] heading error that systematic departures leave
    outliers: int  # readings that were left out

    @property
    def verdict(self) -> str:
        """One line for people."""
        quality = "good" if self.misfit < GOOD_MISFIT else "usable"
        return (
            f"{quality}: covers {degrees(self.coverage):.0f} deg, heading to about"
            f" {max(0.1, degrees(self.misfit)):.1f} deg, {self.outliers} readings left out"
        )


def fit_ellipse(readings: Sequence[Vector], before: ImuCalibration = UNKNOWN) -> CompassFit:
    """Calibrate chip x and y from a flat turn, readings (n, 3) [T]; z, of which that tells
    nothing, stays as the calibration `before` has it.

    CalibrationRefusedError when the turn covers less than 300 degrees or the fit is bad.
    """
    points = _turned(readings, 30)
    return _flat(points, fit_quadric(points[:, :2]), before)


def fit_minmax(readings: Sequence[Vector], before: ImuCalibration = UNKNOWN) -> CompassFit:
    """The same by the smallest and largest reading of chip x and y alone (SCUTTLE): one spike
    spoils it.
    """
    import numpy as np

    points = _turned(readings, 30)
    try:
        found = MinMax.of((float(x), float(y)) for x, y, _ in points)
    except ValueError as error:
        raise CalibrationRefusedError(str(error)) from None
    spans = np.array(found.high) - np.array(found.low)
    shape = np.diag(2.0 / spans)
    quadric = Quadric(np.array(found.offset), shape, np.ones(len(points)))
    return _flat(points, quadric, before)


def _flat(points: "NDArray[Any]", quadric: Quadric, before: ImuCalibration) -> CompassFit:
    import numpy as np

    strength = _strength(quadric)
    unit = (points[:, :2] - quadric.centre) @ quadric.shape
    good = quadric.weights > 0.0
    angles = np.arctan2(unit[good, 1], unit[good, 0])
    gaps = np.diff(np.sort(angles), append=angles.min() + 2.0 * pi)
    coverage = 2.0 * pi - float(gaps.max())
    if coverage < LEAST_COVERAGE:
        raise CalibrationRefusedError(
            f"the turn covers {degrees(coverage):.0f} deg, 300 are needed: turn on one spot"
        )
    radius = np.linalg.norm(unit[good], axis=1) - 1.0
    sectors = ((angles + pi) / (2.0 * pi) * SECTORS).astype(int) % SECTORS
    matrix = np.eye(3)
    matrix[:2, :2] = strength * quadric.shape
    matrix[2, 2] = before.mag_matrix[8]
    offset = (float(quadric.centre[0]), float(quadric.centre[1]), before.mag_offset[2])
    return _judged(quadric, offset, matrix, strength, coverage, radius, sectors)


def fit_ellipsoid(readings: Sequence[Vector]) -> CompassFit:
    """Calibrate all three axes from turns through all directions, readings (n, 3) [T].

    CalibrationRefusedError when the directions leave a side out or the fit is bad.
    """
    import numpy as np

    points = _turned(readings, 100)
    quadric = fit_quadric(points)
    strength = _strength(quadric)
    unit = (points - quadric.centre) @ quadric.shape
    good = quadric.weights > 0.0
    length = np.linalg.norm(unit[good], axis=1)
    directions = unit[good] / length[:, None]
    spread = float(np.linalg.eigvalsh(directions.T @ directions / len(directions)).min())
    sided = float(np.abs(directions.mean(axis=0)).max())
    if spread < LEAST_SPREAD or sided > 0.7:
        raise CalibrationRefusedError(
            f"the turns leave a side out (spread {spread:.2f}, needs {LEAST_SPREAD}):"
            " turn the robot about all three axes"
        )
    octants = (directions > 0.0) @ np.array([1, 2, 4])
    x, y, z = (float(v) for v in quadric.centre)
    coverage = 2.0 * pi * len(np.unique(octants)) / 8.0
    matrix = strength * quadric.shape
    return _judged(quadric, (x, y, z), matrix, strength, coverage, length - 1.0, octants)


def _turned(readings: Sequence[Vector], fewest: int) -> "NDArray[Any]":
    """The readings as an array. Refuses those of a robot that did not turn."""
    import numpy as np

    points = checked(readings, fewest, "magnetometer")
    low, high = np.percentile(points, (2.5, 97.5), axis=0)
    change = (high - low).max()
    if change < min(LEAST_FIELD, LEAST_CHANGE * np.linalg.norm(points.mean(axis=0))):
        raise CalibrationRefusedError("the readings do not change enough: turn the robot")
    return points


def _strength(quadric: Quadric) -> float:
    """Radius of the sphere of the same size [unit of the readings]. Refuses a stretched fit."""
    import numpy as np

    values = np.linalg.eigvalsh(quadric.shape)
    if values.max() > LARGEST_RATIO * values.min():
        raise CalibrationRefusedError(
            f"one axis sees {values.max() / values.min():.1f} times the field of another:"
            " iron very near, or the robot did not turn freely"
        )
    return float(np.prod(values) ** (-1.0 / len(values)))


def _judged(
    quadric: Quadric,
    offset: Vector,
    matrix: "NDArray[Any]",
    strength: float,
    coverage: float,
    radius: "NDArray[Any]",
    sectors: "NDArray[Any]",
) -> CompassFit:
    """The fit with its figures. Refuses many outliers, much noise or a systematic misfit."""
    import numpy as np

    total = len(quadric.weights)
    outliers = total - len(radius)
    if outliers > MOST_OUTLIERS * total:
        raise CalibrationRefusedError(
            f"{outliers} of {total} readings fit no ellipse: something magnetic moved nearby"
        )
    noise = float(radius.std())
    means = np.array([radius[sectors == i].mean() for i in np.unique(sectors)])
    counts = np.array([(sectors == i).sum() for i in np.unique(sectors)])
    # what averaging leaves of the noise is no misfit
    systematic = float((means * means - noise * noise / counts).mean())
    misfit = max(0.0, systematic) ** 0.5
    if noise > LARGEST_NOISE or misfit > LARGEST_MISFIT:
        raise CalibrationRefusedError(
            f"the fit is bad (noise {noise:.2f} of the field, misfit {degrees(misfit):.1f} deg):"
            " keep away from iron and do not tilt"
        )
    a, b, c, d, e, f, g, h, i = (float(v) for v in matrix.ravel())
    return CompassFit(
        offset, (a, b, c, d, e, f, g, h, i), strength, coverage, noise, misfit, outliers
    )
