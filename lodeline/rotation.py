"""Rotations in plain floats: quaternions, matrices, roll/pitch/yaw and angles.

Every rotation here takes body to world: ``v_world = R v_body`` with R = Rz(yaw) Ry(pitch) Rx(roll).
World is ENU, body is FLU, angles are radians, yaw 0 is east and grows counter-clockwise.
Quaternions are (x, y, z, w), of unit norm unless said otherwise; a matrix is a tuple of three rows.
"""

from math import asin, atan2, copysign, cos, hypot, pi, remainder, sin, sqrt, tau

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)

# Nearer than this to a vertical x axis, roll and yaw turn about the same axis.
_GIMBAL = 1.0 - 1e-12


def wrap_angle(angle: float) -> float:
    """Bring an angle [rad] to (-pi, pi]. NaN stays NaN; an infinite angle raises ValueError."""
    if -pi < angle <= pi:
        return angle
    wrapped = remainder(angle, tau)
    return pi if wrapped <= -pi else wrapped


def normalized(q: Quaternion) -> Quaternion:
    """The unit quaternion along q. Raises ValueError when q has no direction (zero, NaN, inf)."""
    x, y, z, w = q
    norm = sqrt(x * x + y * y + z * z + w * w)
    if not 0.0 < norm < float("inf"):
        raise ValueError(f"quaternion {q} has no direction")
    return (x / norm, y / norm, z / norm, w / norm)


def conjugate(q: Quaternion) -> Quaternion:
    """The opposite rotation: world to body when q is body to world."""
    return (-q[0], -q[1], -q[2], q[3])


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: rotate by b first, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turned_about_z(q: Quaternion, angle: float) -> Quaternion:
    """Rotate by q first, then by `angle` [rad] about the vertical axis of the world."""
    x, y, z, w = q
    s, c = sin(0.5 * angle), cos(0.5 * angle)
    return (c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z)


def rotate(q: Quaternion, v: Vector) -> Vector:
    """R(q) v: a body vector in world axes, for a body to world quaternion of unit norm."""
    x, y, z, w = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def height(q: Quaternion, v: Vector) -> float:
    """The third part of R(q) v: along the vertical axis of the world."""
    x, y, z, w = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return vz + w * tz + x * ty - y * tx


def from_rotation_vector(v: Vector) -> Quaternion:
    """Quaternion of the turn by |v| [rad] about v; exact for any length, also zero."""
    x, y, z = v
    squared = x * x + y * y + z * z
    if squared < 1e-8:  # two terms of the series are exact to a double here
        s = 0.5 - squared / 48.0
        return (s * x, s * y, s * z, 1.0 - squared / 8.0)
    angle = sqrt(squared)
    s = sin(0.5 * angle) / angle
    return (s * x, s * y, s * z, cos(0.5 * angle))


def to_rotation_vector(q: Quaternion) -> Vector:
    """The shortest rotation vector [rad, |v| <= pi] of a unit quaternion."""
    x, y, z, w = q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    length = sqrt(x * x + y * y + z * z)
    scale = 2.0 if length < 1e-9 else 2.0 * atan2(length, w) / length
    return (scale * x, scale * y, scale * z)


def from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Quaternion of Rz(yaw) Ry(pitch) Rx(roll), angles in rad."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def to_euler(q: Quaternion) -> Vector:
    """(roll, pitch, yaw) [rad] of a unit quaternion; with x vertical, roll is 0 by convention.

    (5) of the DCM paper: pitch = -asin r31, roll = atan2(r32, r33), yaw = atan2(r21, r11). Its
    print negates all three, takes the pitch from phi, and has the quotient of the yaw upside down.
    """
    x, y, z, w = q
    s = 2.0 * (w * y - x * z)
    if abs(s) >= _GIMBAL:
        return (0.0, copysign(0.5 * pi, s), wrap_angle(2.0 * atan2(z, w)))
    roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return (roll, asin(s), yaw)


def yaw_of(q: Quaternion) -> float:
    """Yaw [rad] of a unit quaternion, 0 = east, counter-clockwise positive."""
    x, y, z, w = q
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def tilt_of(q: Quaternion) -> float:
    """Angle [rad] between the body's z axis and the vertical, for a unit quaternion."""
    x, y, z, w = q
    return 2.0 * atan2(hypot(x, y), hypot(z, w))


def to_matrix(q: Quaternion) -> Matrix:
    """Rotation matrix (rows) of a unit quaternion."""
    x, y, z, w = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def from_matrix(r: Matrix) -> Quaternion:
    """Unit quaternion (w >= 0) of a rotation matrix, found by its largest component."""
    (a, b, c), (d, e, f), (g, h, i) = r
    squares = (1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i, 1.0 + a + e + i)
    largest = max(range(4), key=squares.__getitem__)
    q: Quaternion
    if largest == 3:
        q = (h - f, c - g, d - b, squares[3])
    elif largest == 0:
        q = (squares[0], d + b, c + g, h - f)
    elif largest == 1:
        q = (d + b, squares[1], h + f, c - g)
    else:
        q = (c + g, h + f, squares[2], d - b)
    x, y, z, w = normalized(q)
    return (x, y, z, w) if w >= 0.0 else (-x, -y, -z, -w)


def matrix_from_euler(roll: float, pitch: float, yaw: float) -> Matrix:
    """Rz(yaw) Ry(pitch) Rx(roll) as rows, angles in rad.

    (4) of the DCM paper, which prints Rz(phi) Ry(theta) Rz(psi), with the Rx and Rz of its (3)
    transposed against its Ry; the lecture's three matrices are these.
    """
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def euler_from_matrix(r: Matrix) -> Vector:
    """(roll, pitch, yaw) [rad] of a rotation matrix; with x vertical, roll is 0 by convention."""
    return to_euler(from_matrix(r))


def apply(m: Matrix, v: Vector) -> Vector:
    """m v, for any 3x3 matrix given as rows."""
    (a, b, c), (d, e, f), (g, h, i) = m
    x, y, z = v
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def transpose(m: Matrix) -> Matrix:
    """Rows as columns: the opposite rotation of a rotation matrix."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return ((a, d, g), (b, e, h), (c, f, i))


def compose(a: Matrix, b: Matrix) -> Matrix:
    """a b: apply b first, then a."""
    columns = transpose(b)
    first, second, third = (apply(a, column) for column in columns)
    return transpose((first, second, third))


def determinant(m: Matrix) -> float:
    """Determinant of a 3x3 matrix given as rows."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
