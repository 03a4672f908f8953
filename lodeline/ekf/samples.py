"""What the localiser is told, each with the stamp of its sensor."""

from typing import NamedTuple


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
    """What the IMU says: rate of turn [rad/s], heading and its sigma [rad], tilt [rad].

    `heading_sigma` infinite: there is no north to believe.
    """

    stamp_ns: int
    rate: float
    heading: float
    heading_sigma: float
    tilt: float


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


class Fix(NamedTuple):
    """A measured position of `base_link` in the map, with its standard deviation per axis [m]."""

    x: float
    y: float
    sigma: float


Landmark = Sighting | Fix


class Landmarks(NamedTuple):
    """Landmarks measured at one moment."""

    stamp_ns: int
    seen: tuple[Landmark, ...]


Sample = Motion | Hits | Spin | Landmarks
