"""Turns from gyro samples: over the time between two of them, and beyond the last one."""

from lodeline.rotation import Quaternion, Vector, from_rotation_vector


def turned(before: Vector, now: Vector, bias: Vector, dt: float) -> Vector:
    """Rotation vector [rad] over `dt` [s] between two gyro samples [rad/s], the rate being linear.

    Taking the later sample alone would run half a sample ahead. The cross product is the coning
    term (Magnus expansion to fourth order in dt).
    """
    (ax, ay, az), (cx, cy, cz), (bx, by, bz) = before, now, bias
    ax, ay, az = ax - bx, ay - by, az - bz
    cx, cy, cz = cx - bx, cy - by, cz - bz
    h, k = 0.5 * dt, dt * dt / 12.0
    return (
        h * (ax + cx) + k * (ay * cz - az * cy),
        h * (ay + cy) + k * (az * cx - ax * cz),
        h * (az + cz) + k * (ax * cy - ay * cx),
    )


def ahead(rate: Vector, bias: Vector, latency: float) -> Quaternion:
    """The turn that a sensor late by `latency` [s] has not seen yet, at a rate [rad/s] kept up."""
    (wx, wy, wz), (bx, by, bz) = rate, bias
    turn = latency * (wx - bx), latency * (wy - by), latency * (wz - bz)
    return from_rotation_vector(turn)


def unit(q: Quaternion) -> Quaternion:
    """Pull a nearly unit quaternion back to unit norm, to first order."""
    x, y, z, w = q
    k = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    return (k * x, k * y, k * z, k * w)
