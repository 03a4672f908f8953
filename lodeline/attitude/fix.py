"""Orientation without a gyro: which way is up, and where north is."""

from math import atan2, hypot, pi

from lodeline.rotation import Quaternion, Vector, from_euler, multiply, rotate, wrap_angle

# A level field weaker than this [T] points nowhere.
FAINTEST_FIELD = 1e-6


def tilt_of(a: Vector) -> Quaternion:
    """Roll and pitch under which specific force `a` points straight up; yaw 0. Identity for 0."""
    ax, ay, az = a
    return from_euler(atan2(ay, az), atan2(-ax, hypot(ay, az)), 0.0)


def points_somewhere(level_field: Vector) -> bool:
    """True for a field [T] in level axes strong enough to give a heading."""
    return hypot(level_field[0], level_field[1]) > FAINTEST_FIELD


def north_yaw(level_field: Vector, declination: float) -> float:
    """Yaw [rad] by which level axes must turn so that the field in them points to magnetic north.

    Magnetic north lies at azimuth 90 deg - declination, counter-clockwise from true east.
    """
    return wrap_angle(0.5 * pi - declination - atan2(level_field[1], level_field[0]))


def first_fix(a: Vector, m: Vector | None, declination: float) -> Quaternion:
    """Orientation from gravity and north at once; yaw 0 without a magnetic field."""
    tilt = tilt_of(a)
    if m is None:
        return tilt
    yaw = north_yaw(rotate(tilt, m), declination)
    return multiply(from_euler(0.0, 0.0, yaw), tilt)
