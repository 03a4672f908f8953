"""What the localiser is told, each with the stamp of its sensor."""

from typing import NamedTuple

Floats = tuple[float, ...]


class Motion(NamedTuple):
    """An odometry sample: pose in `odom` [m, rad] and covariance of the twist over `interval`."""

    stamp_ns: int
    x: float
    y: float
    yaw: float
    twist_covariance: tuple[float, float, float, float]
    interval: float
    resets: int


class Hits(NamedTuple):
    """A reading of the reed bar: lateral offsets of the magnets under it [m], maybe none."""

    stamp_ns: int
    laterals: tuple[float, ...]


class Spin(NamedTuple):
    """What the IMU says all the time: rate of turn [rad/s] about the vertical, tilt [rad]."""

    stamp_ns: int
    rate: float
    tilt: float


class Heading(NamedTuple):
    """What the compass says: yaw and its standard deviation [rad]."""

    stamp_ns: int
    yaw: float
    sigma: float


class Sighting(NamedTuple):
    """A landmark at (`x`, `y`) [m] of the map, seen from `base_link`: `range` [m], `bearing` [rad].

    Either may be None; left is positive. Sigmas are standard deviations in the same units.
    """

    x: float
    y: float
    range: float | None
    range_sigma: float
    bearing: float | None = None
    bearing_sigma: float = 1.0


class Landmarks(NamedTuple):
    """Landmarks seen at one moment."""

    stamp_ns: int
    seen: tuple[Sighting, ...]


class Fix(NamedTuple):
    """A measured position of `base_link` in the map, with its standard deviation per axis [m]."""

    stamp_ns: int
    x: float
    y: float
    sigma: float


Measurement = Hits | Heading | Landmarks | Fix
Sample = Motion | Measurement


def sightings(
    x: Floats,
    y: Floats,
    ranges: Floats,
    range_sigmas: Floats,
    bearings: Floats,
    bearing_sigmas: Floats,
) -> tuple[Sighting, ...]:
    """Sightings of the landmarks at (x, y) [m]: part i of each array is of landmark i.

    Ranges [m] or bearings [rad] are empty where they were not measured. ValueError if the arrays
    do not belong together.
    """
    count = len(x)
    ways, turns = (ranges, range_sigmas), (bearings, bearing_sigmas)
    if len(y) != count or any({len(a), len(b)} not in ({count}, {0}) for a, b in (ways, turns)):
        raise ValueError(f"{count} landmarks, but not as many of everything that is said of them")
    none = (None,) * count, (1.0,) * count
    seen = zip(x, y, *(ways if ranges else none), *(turns if bearings else none), strict=True)
    return tuple(Sighting(*each) for each in seen)
