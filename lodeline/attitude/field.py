"""How far a magnetic field looks like the earth's: weight by strength and dip against a reference.

The reference is learned in the first seconds and follows slowly. Magnets and iron nearby change
strength and dip along with the heading, so a field that is off in these is given little say about
the heading. So is one that suddenly points elsewhere: a magnet to the east or west shows in nothing
but that. A reference that was itself taken beside a magnet would keep the true field out for ever:
another field that stays the same while the body turns about is adopted in its place.
"""

from dataclasses import dataclass
from math import asin, pi, sqrt, tau
from typing import Annotated

from lodeline.attitude.base import AttitudeParams, AttitudeState, positive
from lodeline.rotation import Vector

# Below this weight a field would take minutes to come back by itself.
HOPELESS = 0.02
# A field right in strength and dip that points elsewhere is believed after a quarter of this [s].
DOUBT_TIME = 480.0
ADOPT_TIME = 20.0  # [s] that another field must stay the same
ADOPT_TURN = tau  # [rad] through which the body must turn in that time
TURNING = 0.1  # [rad/s] slower rates are noise and do not count


@dataclass(frozen=True, slots=True)
class FieldParams(AttitudeParams):
    """How much strength and dip may stray, and how fast the reference is learned."""

    # Relative to the strength learned: two sigma where a calibration leaves 1 uT of 50. A stray
    # field as strong as that turns a compass by up to asin(0.04 / cos dip), 7 deg at a dip of 70.
    norm_tolerance: Annotated[float, "1"] = 0.04
    dip_tolerance: Annotated[float, "rad"] = 0.14  # tilt errors of a shaken body show here too
    heading_tolerance: Annotated[float, "rad"] = 0.3  # beside the heading known so far
    learn_time: Annotated[float, "s"] = 5.0
    reference_time: Annotated[float, "s"] = 60.0

    def __post_init__(self) -> None:
        positive(
            norm_tolerance=self.norm_tolerance,
            dip_tolerance=self.dip_tolerance,
            heading_tolerance=self.heading_tolerance,
            learn_time=self.learn_time,
            reference_time=self.reference_time,
        )


@dataclass(slots=True)
class FieldState(AttitudeState):
    """The reference, and another field that may take its place."""

    field_age: float = -1.0  # of the reference [s], negative before the first field
    field_norm: float = 0.0  # [T]
    field_dip: float = 0.0  # [rad]
    weight: float = 0.0  # of the last field
    other_age: float = 0.0
    other_turn: float = 0.0
    other_norm: float = 0.0
    other_dip: float = 0.0
    other_off: float = 0.0


def norm_and_dip(level_field: Vector) -> tuple[float, float]:
    """Strength [T] and dip [rad, positive downwards as in the north] of a field in level axes."""
    x, y, z = level_field
    norm = sqrt(x * x + y * y + z * z)
    return norm, -asin(max(-1.0, min(1.0, z / norm))) if norm > 0.0 else 0.0


def weigh(
    s: FieldState,
    p: FieldParams,
    level_field: Vector,
    off: float,
    heading_variance: float,
) -> float:
    """Set `s.weight` (0 to 1) for a field [T] in level axes and let the reference follow it.

    `off` [rad] is what the compass says beyond a heading of `heading_variance` [rad^2]. Returns the
    variance [rad^2] to be added to the heading's, because the field contradicts it and one of the
    two is wrong.
    """
    dt = s.field_wait
    norm, dip = norm_and_dip(level_field)
    if s.field_age < 0.0:
        s.field_age, s.field_norm, s.field_dip, s.weight = 0.0, norm, dip, 1.0
        return 0.0
    s.field_age += dt
    strange = _strangeness(p, norm, dip, s.field_norm, s.field_dip)
    turned = (off * off / (p.heading_tolerance * p.heading_tolerance + 4.0 * heading_variance)) ** 2
    s.weight = weight = _say(strange + turned)
    if s.field_age < p.learn_time:  # a running mean
        share = dt / s.field_age if dt > 0.0 else 0.0
    else:
        share = min(1.0, weight * dt / p.reference_time)
    s.field_norm += share * (norm - s.field_norm)
    s.field_dip += share * (dip - s.field_dip)
    if weight < HOPELESS and _adopted(s, p, norm, dip, off):
        return off * off
    if weight >= HOPELESS:
        s.other_age = 0.0
    return (_say(strange) - weight) * off * off * min(1.0, dt / DOUBT_TIME)


def strangeness(s: FieldState, p: FieldParams, level_field: Vector) -> float:
    """Squared distance of a field [T] in level axes from the reference, in tolerances."""
    return _strangeness(p, *norm_and_dip(level_field), s.field_norm, s.field_dip)


def disturbed(s: FieldState) -> bool:
    """True while strength or dip of the field are those of another place, or of a magnet."""
    return s.field_age >= 0.0 and s.weight < HOPELESS


def _adopted(s: FieldState, p: FieldParams, norm: float, dip: float, off: float) -> bool:
    """Watch another field; true when it has just become the reference."""
    dt = s.field_wait
    wx, wy, wz = s.rate
    rate = sqrt(wx * wx + wy * wy + wz * wz)
    away = (off - s.other_off + pi) % tau - pi
    strange = _strangeness(p, norm, dip, s.other_norm, s.other_dip) if s.other_age > 0.0 else 2.0
    if strange + (away / p.heading_tolerance) ** 2 > 1.0:
        s.other_age, s.other_turn = dt, 0.0
        s.other_norm, s.other_dip, s.other_off = norm, dip, off
        return False
    s.other_age += dt
    s.other_turn += rate * dt if rate > TURNING else 0.0
    share = dt / s.other_age
    s.other_norm += share * (norm - s.other_norm)
    s.other_dip += share * (dip - s.other_dip)
    s.other_off += share * away
    if s.other_age < ADOPT_TIME or s.other_turn < ADOPT_TURN:
        return False
    s.field_norm, s.field_dip, s.other_age = s.other_norm, s.other_dip, 0.0
    return True


def _strangeness(p: FieldParams, norm: float, dip: float, of_norm: float, of_dip: float) -> float:
    a = (norm / of_norm - 1.0) / p.norm_tolerance
    b = (dip - of_dip) / p.dip_tolerance
    return a * a + b * b


def _say(strange: float) -> float:
    return 1.0 / ((1.0 + strange) * (1.0 + strange))
