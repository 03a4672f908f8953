"""A magnet on the body itself: found, because it turns with the body, and taken out of the field.

What a field has beyond the earth's either stays with the room or turns with the body. As long as
the body stands still nobody can tell; while it turns, the deviation wanders in one of the two
frames and keeps still in the other. Kept still in the body, it is a magnet that rides along (a
payload, a motor, a tool laid down beside the sensor), and its field can be subtracted.
"""

from dataclasses import dataclass
from math import cos, sin

from lodeline.attitude.field import FieldParams, FieldState, strangeness
from lodeline.rotation import Quaternion, Vector, conjugate, rotate

WATCH_TIME = 5.0  # [s] over which the deviation is averaged in both frames
STEADIER = 4.0  # times less variance in the body than in the room: it is the body's
LARGER = 4.0  # times its own variance, squared size of what is worth taking out
_NONE: Vector = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class IronState(FieldState):
    """The body's own field, and the deviation from the reference in both frames [T, T^2]."""

    iron: Vector = _NONE  # body axes
    watched: float = 0.0  # [s]
    in_body: Vector = _NONE
    in_room: Vector = _NONE
    body_variance: float = 0.0
    room_variance: float = 0.0


def without_iron(
    s: IronState, p: FieldParams, field: Vector, level: Quaternion, azimuth: float
) -> Vector:
    """A field [T] in level axes, less what rides on the body where that looks more like the earth.

    `level` turns body axes into the level ones, `azimuth` [rad] is where magnetic north lies in
    these. A magnet that was taken off again needs no forgetting: the field is better without.
    """
    if s.field_age < 0.0:
        return field
    _watch(s, field, level, azimuth)
    if s.iron == _NONE:
        return field
    (x, y, z), (ix, iy, iz) = field, rotate(level, s.iron)
    freed = (x - ix, y - iy, z - iz)
    if strangeness(s, p, freed) > strangeness(s, p, field):
        return field
    return freed


def _watch(s: IronState, field: Vector, level: Quaternion, azimuth: float) -> None:
    """Average the deviation from the reference in both frames; believe the steadier one."""
    s.watched = min(s.watched + s.field_wait, WATCH_TIME)
    share = s.field_wait / s.watched if s.watched > 0.0 else 0.0
    across, up = s.field_norm * cos(s.field_dip), -s.field_norm * sin(s.field_dip)
    x, y, z = field
    room = (x - across * cos(azimuth), y - across * sin(azimuth), z - up)
    body = rotate(conjugate(level), room)
    s.in_room, s.room_variance = _averaged(s.in_room, s.room_variance, room, share)
    s.in_body, s.body_variance = mean, variance = _averaged(s.in_body, s.body_variance, body, share)
    bx, by, bz = mean
    if s.room_variance > STEADIER * variance and bx * bx + by * by + bz * bz > LARGER * variance:
        s.iron = mean


def _averaged(mean: Vector, variance: float, now: Vector, share: float) -> tuple[Vector, float]:
    (x, y, z), (a, b, c) = mean, now
    dx, dy, dz = a - x, b - y, c - z
    variance += share * (dx * dx + dy * dy + dz * dz - variance)
    return (x + share * dx, y + share * dy, z + share * dz), variance
