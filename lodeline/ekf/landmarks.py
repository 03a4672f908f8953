"""Measurements to known points: range and bearing, range alone, or a position itself.

Each is a few numbers with independent errors, which correct the belief one after the other, by
either engine, after one gate for them all.
"""

import math
from typing import NamedTuple

from lodeline.ekf.belief import Belief
from lodeline.ekf.engine import Engine, Row
from lodeline.ekf.mixture import Hypothesis, reduced
from lodeline.ekf.samples import Fix, Sighting
from lodeline.ekf.track import Track
from lodeline.ekf.trust import RECENT
from lodeline.rotation import wrap_angle

GATES = {1: 10.83, 2: 13.82}  # chi-square, 99.9 %, by degrees of freedom
NEAREST = 0.05  # m: from closer a landmark has no bearing to speak of
STRAY = 1e-3  # likelihood of a sighting of something else, in the same units
MISSED_SIGMA = (0.3, 0.1)  # m, rad: more doubt after eight landmarks in a row that did not fit


class Number(NamedTuple):
    """One number: its derivatives by the pose, what it is off by, and its variance."""

    row: Row
    residual: float
    variance: float


def sighted(engine: Engine, track: Track, landmark: Sighting | Fix) -> Track:
    """After one landmark: it weighs the hypotheses and corrects those that it fits."""
    children, fits, nis = [], False, math.inf
    for weight, belief in track.mixture:
        seen = numbers(belief, landmark)
        distance, likely = weighed(belief, seen)
        nis = min(nis, distance)
        if distance > GATES[len(seen)]:
            children.append(Hypothesis(STRAY * weight, belief))
            continue
        fits = True
        after = corrected(engine, belief, seen)
        children.append(Hypothesis(weight * max(likely, STRAY), after))
    trust = track.trust.after_landmark(nis, rejected=not fits)
    if fits:
        return track._replace(mixture=reduced(children), trust=trust)
    if trust.streak > -RECENT:
        return track._replace(trust=trust)
    return track._replace(trust=trust._replace(streak=0)).widened(*MISSED_SIGMA)


def numbers(belief: Belief, landmark: Sighting | Fix) -> list[Number]:
    """What a landmark says, linearised at the belief's mean."""
    if isinstance(landmark, Fix):
        variance = landmark.sigma**2
        return [
            Number((1.0, 0.0, 0.0), landmark.x - belief.x, variance),
            Number((0.0, 1.0, 0.0), landmark.y - belief.y, variance),
        ]
    dx, dy = landmark.x - belief.x, landmark.y - belief.y
    distance = max(math.hypot(dx, dy), NEAREST)
    found = []
    if landmark.range is not None:
        row = (-dx / distance, -dy / distance, 0.0)
        found.append(Number(row, landmark.range - distance, landmark.range_sigma**2))
    if landmark.bearing is not None:
        row = (dy / distance**2, -dx / distance**2, -1.0)
        off = wrap_angle(landmark.bearing - math.atan2(dy, dx) + belief.yaw)
        found.append(Number(row, off, landmark.bearing_sigma**2))
    return found


def weighed(belief: Belief, seen: list[Number]) -> tuple[float, float]:
    """(squared Mahalanobis distance, likelihood) of one or two numbers together.

    The likelihood is in units of that of a perfect prediction: at most 1.
    """
    first = seen[0]
    u = _times(belief, first.row)
    s00 = _dot(first.row, u) + first.variance
    nis, share = first.residual**2 / s00, first.variance / s00
    if len(seen) == 2:
        second = seen[1]
        ratio = _dot(second.row, u) / s00
        s11 = _dot(second.row, _times(belief, second.row)) + second.variance
        rest = max(s11 - ratio * ratio * s00, second.variance)
        nis += (second.residual - ratio * first.residual) ** 2 / rest
        share *= second.variance / rest
    return nis, math.sqrt(share) * math.exp(-0.5 * min(nis, 1400.0))


def corrected(engine: Engine, belief: Belief, seen: list[Number]) -> Belief:
    """The belief after the numbers of one landmark, all linearised where the first was."""
    after = belief
    for row, residual, variance in seen:
        moved = (after.x - belief.x, after.y - belief.y, wrap_angle(after.yaw - belief.yaw))
        after = engine.correct_scalar(after, row, residual - _dot(row, moved), variance)
    return after.positive()


def _times(belief: Belief, row: Row) -> Row:
    """P h^T."""
    _, _, _, p00, p01, p02, p11, p12, p22 = belief
    h0, h1, h2 = row
    return (
        p00 * h0 + p01 * h1 + p02 * h2,
        p01 * h0 + p11 * h1 + p12 * h2,
        p02 * h0 + p12 * h1 + p22 * h2,
    )


def _dot(a: Row, b: Row) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
