"""Which way is up, by a low-pass in the frame that the gyro integrates.

In that frame gravity stands still while shaking averages out, so the filter may be slow without
lagging behind the body (the idea of VQF: Laidig and Seel, Information Fusion 91, 2023).
"""

from dataclasses import dataclass
from math import sqrt

from lodeline.attitude.rest import RestState
from lodeline.attitude.strapdown import unit
from lodeline.rotation import IDENTITY, Quaternion, Vector, rotate


@dataclass(slots=True)
class GravityState(RestState):
    """Two steps from the body to level axes: I is the frame the gyro integrates in, E is level."""

    age: float = 0.0  # since the start or the last hole [s]
    strapdown: Quaternion = IDENTITY  # body to I
    tilt: Quaternion = IDENTITY  # I to E
    gravity: Vector = (0.0, 0.0, 0.0)  # filtered specific force in I [m/s^2], and its rate
    gravity_rate: Vector = (0.0, 0.0, 0.0)


def level(s: GravityState, tilt_time: float, dt: float, force: Vector) -> None:
    """Low-pass the specific force (body axes) in I and stand the result upright in E."""
    ux, uy, uz = rotate(s.strapdown, force)
    x, y, z = s.gravity
    if s.age < tilt_time:  # a running mean until the filter has something to stand on
        share = dt / (s.age + dt) if dt > 0.0 else 0.0
        s.gravity = x, y, z = x + share * (ux - x), y + share * (uy - y), z + share * (uz - z)
    else:  # Butterworth of second order, semi-implicit Euler: any dt, no coefficients to keep
        h = min(dt, 0.2 * tilt_time)
        vx, vy, vz = s.gravity_rate
        corner = sqrt(2.0) / tilt_time
        spring, damping = h * corner * corner, 1.0 - h * sqrt(2.0) * corner
        vx = damping * vx + spring * (ux - x)
        vy = damping * vy + spring * (uy - y)
        vz = damping * vz + spring * (uz - z)
        s.gravity_rate = (vx, vy, vz)
        s.gravity = x, y, z = x + h * vx, y + h * vy, z + h * vz
    ex, ey, ez = rotate(s.tilt, (x, y, z))
    norm = sqrt(ex * ex + ey * ey + ez * ez)
    if norm > 0.0:
        # the shortest turn from the filtered vector to straight up
        half = sqrt(max(0.5 * (ez / norm + 1.0), 1e-12))
        a, b = 0.5 * ey / (norm * half), -0.5 * ex / (norm * half)
        x, y, z, w = s.tilt
        # (a, b, 0, half) times the tilt
        s.tilt = unit(
            (
                half * x + a * w + b * z,
                half * y - a * z + b * w,
                half * z + a * y - b * x,
                half * w - a * x - b * y,
            )
        )
