"""Calibration from a sensor that lies still: the gyro's zero-point, the accelerometer's axes.

The gyro needs one rest of a few seconds. The accelerometer needs one rest on each of its six sides
(roughly will do): there the length of gravity is known, and offset and scale of every axis follow
from it. Readings are in chip axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, radians
from typing import TYPE_CHECKING, Any

from lodeline.calibration.quality import CalibrationRefusedError, checked
from lodeline.rotation import Vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

GRAVITY = 9.80665
SHORTEST_REST = 2.0  # [s]
LARGEST_ZERO = radians(20.0)  # [rad/s] no working gyro reads more at rest
LARGEST_SWAY = radians(1.0)  # [rad/s] by which means over half a second may differ at rest
LARGEST_SHAKE = 0.3  # [m/s^2] likewise
LARGEST_ROLL = 2.5  # [tick] by which means of the counts over half a second may differ at rest
LARGEST_MISFIT = 0.1  # [m/s^2] RMS of the length of gravity after calibration
UNKNOWNS = 6  # offset and scale of three axes
LEAST_LEAN = 0.7  # [g] that every axis must have seen both ways
SCALES = (0.8, 1.25)
WINDOW = 0.5  # [s] over which readings are averaged before they are compared


@dataclass(frozen=True, slots=True)
class GyroZero:
    """The gyro at rest."""

    zero: Vector  # [rad/s]
    error: float  # [rad/s] standard error of it, largest axis
    duration: float  # [s]

    @property
    def verdict(self) -> str:
        """One line for people."""
        x, y, z = (degrees(v) for v in self.zero)
        return (
            f"zero-point {x:.3f} {y:.3f} {z:.3f} deg/s, known to {degrees(self.error):.4f} deg/s"
            f" after {self.duration:.1f} s"
        )


@dataclass(frozen=True, slots=True)
class AccelFit:
    """Offset [m/s^2] and scale of each axis, as in `ImuCalibration`."""

    offset: Vector
    scale: Vector
    misfit: float  # [m/s^2] RMS of what is left of the length of gravity
    positions: int

    @property
    def verdict(self) -> str:
        """One line for people."""
        if self.positions <= UNKNOWNS:
            return (
                f"from {self.positions} positions, which six numbers always fit: one more, askew,"
                " would put it to the test"
            )
        quality = "good" if self.misfit < 0.3 * LARGEST_MISFIT else "usable"
        return f"{quality}: gravity to {self.misfit:.3f} m/s^2 over {self.positions} positions"


def gyro_zero(
    rates: Sequence[Vector],
    rate_hz: float,
    forces: Sequence[Vector] = (),
    counts: Sequence[tuple[int, int]] = (),
) -> GyroZero:
    """The zero-point from readings (n, 3) [rad/s] taken at rest, `rate_hz` per second.

    An even turn reads as a rest does, and so does a straight drive: `forces` (n, 3) [m/s^2] and
    `counts` of the wheels (m, 2) over the same time, where there are some, tell that it stood.
    CalibrationRefusedError when the rest was too short, the sensor moved or turned, or nothing
    but zeros came in.
    """
    import numpy as np

    points = checked(rates, 2, "gyro")
    duration = len(points) / rate_hz
    if duration < SHORTEST_REST:
        raise CalibrationRefusedError(
            f"{duration:.1f} s of rest are too short, {SHORTEST_REST:.0f} are needed"
        )
    _check_wheels(counts, duration)
    if not points.std(axis=0).any():
        raise CalibrationRefusedError("the gyro reads the same number for ever: is it connected?")
    means = _windows(points, rate_hz)
    sway = np.abs(means - np.median(means, axis=0)).max(axis=1)
    if sway.max() > LARGEST_SWAY:
        raise CalibrationRefusedError(
            f"the sensor moved {int(sway.argmax()) * WINDOW:.1f} s after the start, by"
            f" {degrees(float(sway.max())):.1f} deg/s: put it down and wait"
        )
    _check_forces(forces, rate_hz)
    zero = points.mean(axis=0)
    if np.abs(zero).max() > LARGEST_ZERO:
        raise CalibrationRefusedError(
            f"{degrees(float(np.abs(zero).max())):.0f} deg/s is no zero-point:"
            " it turns, or is broken"
        )
    # from the spread of the half-second means: their noise need not be white
    error = float((means.std(axis=0) / len(means) ** 0.5).max())
    x, y, z = (float(v) for v in zero)
    return GyroZero((x, y, z), error, duration)


def _check_wheels(counts: Sequence[tuple[int, int]], seconds: float) -> None:
    import numpy as np

    if len(counts) < 2:
        return
    means = _windows(np.asarray(counts, dtype=float), len(counts) / seconds)
    rolled = np.ptp(means, axis=0)
    if rolled.max() > LARGEST_ROLL:
        raise CalibrationRefusedError(
            f"the {('left', 'right')[int(rolled.argmax())]} wheel rolled by {rolled.max():.0f}"
            " counts meanwhile: stop the robot, and wait"
        )


def _check_forces(forces: Sequence[Vector], rate_hz: float) -> None:
    import numpy as np

    if len(forces) < 2:
        return
    points = checked(forces, 2, "accelerometer")
    means = _windows(points, rate_hz)
    sway = np.abs(means - np.median(means, axis=0)).max(axis=1)
    shake = float(np.abs(points - points.mean(axis=0)).mean(axis=0).max())
    if max(sway.max(), shake) > LARGEST_SHAKE:
        raise CalibrationRefusedError(
            f"it was pushed or shaken, by {max(float(sway.max()), shake):.1f} m/s^2: stop the"
            " robot, put it down, and wait"
        )


def resting_means(
    forces: Sequence[Vector], rates: Sequence[Vector], rate_hz: float
) -> list[Vector]:
    """Mean specific force [m/s^2] of every rest of a recording of both sensors, (n, 3) each.

    A rest is a stretch of half a second or more in which neither sensor changes; rests in the same
    position are counted once each.
    """
    import numpy as np

    a, w = checked(forces, 2, "accelerometer"), checked(rates, 2, "gyro")
    size = max(2, round(WINDOW * rate_hz))
    zero = np.median(w, axis=0)
    rests: list[list[Any]] = [[]]
    for start in range(0, min(len(a), len(w)) - size + 1, size):
        force, rate = a[start : start + size], w[start : start + size]
        quiet = (
            np.abs(rate.mean(axis=0) - zero).max() < 3.0 * LARGEST_SWAY
            and np.abs(force - force.mean(axis=0)).mean() < LARGEST_SHAKE
        )
        mean = force.mean(axis=0)
        same = not rests[-1] or np.abs(mean - rests[-1][-1]).max() < LARGEST_SHAKE
        if quiet and same:
            rests[-1].append(mean)
        elif quiet:
            rests.append([mean])
        elif rests[-1]:
            rests.append([])
    means = [np.mean(rest, axis=0) for rest in rests if rest]
    return [(float(x), float(y), float(z)) for x, y, z in means]


def fit_accelerometer(positions: Sequence[Vector]) -> AccelFit:
    """Offset and scale from the mean readings [m/s^2] of six or more resting positions.

    Solves |scale (reading - offset)| = g by Gauss-Newton. CalibrationRefusedError when an axis was
    not turned both up and down, or the readings fit no such model.
    """
    import numpy as np

    points = checked(positions, 1, "resting accelerometer")
    for axis, name in enumerate("xyz"):
        low, high = points[:, axis].min() / GRAVITY, points[:, axis].max() / GRAVITY
        if low > -LEAST_LEAN or high < LEAST_LEAN:
            way = "down" if low > -LEAST_LEAN else "up"
            raise CalibrationRefusedError(f"lay it down with its {name} axis pointing {way}, too")
    offset, scale = np.zeros(3), np.ones(3)
    for _ in range(20):
        v = points - offset
        u = v * scale
        length = np.linalg.norm(u, axis=1)
        slope = np.hstack([-u * scale, u * v]) / length[:, None]
        step = np.linalg.lstsq(slope, GRAVITY - length, rcond=None)[0]
        offset, scale = offset + step[:3], scale + step[3:]
        if np.abs(step).max() < 1e-12:
            break
    misfit = float(
        np.sqrt(np.mean((np.linalg.norm((points - offset) * scale, axis=1) - GRAVITY) ** 2))
    )
    if not (misfit <= LARGEST_MISFIT and SCALES[0] < scale.min() and scale.max() < SCALES[1]):
        raise CalibrationRefusedError(
            f"the positions fit no offset and scale (gravity to {misfit:.2f} m/s^2): it was moving,"
            " or its range is set wrongly"
        )
    x, y, z = (float(v) for v in offset)
    sx, sy, sz = (float(v) for v in scale)
    return AccelFit((x, y, z), (sx, sy, sz), misfit, len(points))


def _windows(points: "NDArray[Any]", rate_hz: float) -> "NDArray[Any]":
    """Means over consecutive half seconds."""
    size = max(1, round(WINDOW * rate_hz))
    whole = len(points) // size
    means: NDArray[Any] = points[: whole * size].reshape(whole, size, -1).mean(axis=1)
    return means
