"""Equations of the DCM paper that need no filter: one step of the matrix, and the tilted compass.

Source: Herman et al., "Implementation of Direction Cosine Matrix on a PSoC-5 Microcontroller for
Robot Localization on Inclined Terrains"; equation numbers are that paper's. It works in FRD axes
with a heading clockwise from north; here everything is FLU and ENU. `yaw_from_heading` is the only
place where headings are turned over.
"""

from math import atan2, pi, sqrt

from lodeline.rotation import (
    Matrix,
    Vector,
    compose,
    from_rotation_vector,
    to_matrix,
    wrap_angle,
)


def yaw_from_heading(heading: float) -> float:
    """Yaw [rad] (from east, counter-clockwise) of a heading [rad] (from north, clockwise)."""
    return wrap_angle(0.5 * pi - heading)


def flu_from_frd(v: Vector) -> Vector:
    """A vector given in forward-right-down axes, in forward-left-up axes (and the reverse)."""
    return (v[0], -v[1], -v[2])


def tilt_compensated_yaw(rows: Matrix, field: Vector, declination: float) -> float:
    """Yaw [rad] by compass on a slope, from roll and pitch of the matrix and the field in FLU."""
    r31, r32, r33 = rows[2]  # (5): sin pitch = -r31, tan roll = r32 / r33
    cos_pitch = sqrt(r32 * r32 + r33 * r33)
    if cos_pitch > 0.0:
        sin_roll, cos_roll = r32 / cos_pitch, r33 / cos_pitch
    else:
        sin_roll, cos_roll = 0.0, 1.0
    mx, my, mz = field
    # Both lines read the same in FRD and FLU: m.y, m.z and pitch change sign together.
    mag_x = mx * cos_pitch - my * sin_roll * r31 - mz * cos_roll * r31  # (20)
    mag_y = my * cos_roll - mz * sin_roll  # (21)
    return wrap_angle(0.5 * pi - declination - atan2(mag_y, mag_x))


def turned_matrix(rows: Matrix, turn: Vector, largest: float) -> Matrix:
    """The matrix after a small turn [rad] about body axes, orthonormal again.

    A turn larger than `largest` [rad] is done exactly, as (19) is of first order. The print has a
    dot for the cross product of (7), no (9) at all, dots for the products of scalar and row in
    (13)-(15), and dt w, which is the turn only, for the new matrix in (19).
    """
    tx, ty, tz = turn
    (a, b, c), (d, e, f), _ = rows
    if tx * tx + ty * ty + tz * tz > largest * largest:
        (a, b, c), (d, e, f), _ = compose(rows, to_matrix(from_rotation_vector(turn)))
    else:  # (9) and (19): R (I + [w dt]x), exact to first order; the third row follows from (12)
        a, b, c = a + b * tz - c * ty, b + c * tx - a * tz, c + a * ty - b * tx
        d, e, f = d + e * tz - f * ty, e + f * tx - d * tz, f + d * ty - e * tx
    half = 0.5 * (a * d + b * e + c * f)  # (10)
    a, b, c, d, e, f = (  # (11)
        a - half * d,
        b - half * e,
        c - half * f,
        d - half * a,
        e - half * b,
        f - half * c,
    )
    g, h, i = b * f - c * e, c * d - a * f, a * e - b * d  # (12)
    k = 0.5 * (3.0 - (a * a + b * b + c * c))  # (13)
    m = 0.5 * (3.0 - (d * d + e * e + f * f))  # (14)
    n = 0.5 * (3.0 - (g * g + h * h + i * i))  # (15)
    return ((k * a, k * b, k * c), (m * d, m * e, m * f), (n * g, n * h, n * i))
