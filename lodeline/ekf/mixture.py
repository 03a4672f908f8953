"""A Gaussian mixture of poses: one hypothesis for each magnet that may have been the one seen."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lodeline.ekf.belief import Belief
from lodeline.rotation import wrap_angle

MOST = 40  # hypotheses
LEAST = 1e-4  # of all weight: a hypothesis below it is dropped
SAME_PLACE = 0.004  # m: closer together than this, and
SAME_HEADING = 0.05  # rad: turned by less than this, two hypotheses are one


class Hypothesis(NamedTuple):
    """A belief and how likely it is to be the true one (weights of a mixture sum to 1)."""

    weight: float
    belief: Belief


Mixture = tuple[Hypothesis, ...]
"""Hypotheses by falling weight; never empty."""


def reduced(hypotheses: Sequence[Hypothesis]) -> Mixture:
    """Sorted, without the unlikely and the doubles, at most `MOST`, weights summing to 1.

    Two that are the same pose become one with the mean and the covariance of both.
    """
    total = sum(each.weight for each in hypotheses)
    kept: list[Hypothesis] = []
    for one in sorted(hypotheses, key=lambda each: -each.weight):
        if one.weight < LEAST * total:
            break
        for i, other in enumerate(kept):
            if _same(one.belief, other.belief):
                kept[i] = _merged(other, one)
                break
        else:
            kept.append(one)
    kept.sort(key=lambda each: -each.weight)
    del kept[MOST:]
    total = sum(each.weight for each in kept)
    return tuple(Hypothesis(each.weight / total, each.belief) for each in kept)


def certainty(mixture: Mixture, cell: float) -> float:
    """Probability that the pose is in the cell [m] of the leading hypothesis: near to its place."""
    lead = mixture[0].belief
    return sum(
        weight
        for weight, belief in mixture
        if math.hypot(belief.x - lead.x, belief.y - lead.y) < 0.5 * cell
    )


def spread(mixture: Mixture) -> Belief:
    """The pose of the leading hypothesis, with the mean square of all errors it may have.

    So a pose that is likely one pitch off says so by its covariance too.
    """
    lead = mixture[0].belief
    sums = [0.0] * 6
    for weight, belief in mixture:
        dx, dy, dyaw = belief.x - lead.x, belief.y - lead.y, wrap_angle(belief.yaw - lead.yaw)
        squares = (dx * dx, dx * dy, dx * dyaw, dy * dy, dy * dyaw, dyaw * dyaw)
        for i in range(6):
            sums[i] += weight * (belief[3 + i] + squares[i])
    return Belief(lead.x, lead.y, lead.yaw, *sums)


def _same(a: Belief, b: Belief) -> bool:
    return (
        math.hypot(a.x - b.x, a.y - b.y) < SAME_PLACE
        and abs(wrap_angle(a.yaw - b.yaw)) < SAME_HEADING
    )


def _merged(a: Hypothesis, b: Hypothesis) -> Hypothesis:
    """One Gaussian with the weight, the mean and the covariance of two."""
    weight = a.weight + b.weight
    share, rest = b.weight / weight, a.weight / weight
    one, other = a.belief, b.belief
    dx, dy, dyaw = other.x - one.x, other.y - one.y, wrap_angle(other.yaw - one.yaw)
    between = share * rest
    squares = (dx * dx, dx * dy, dx * dyaw, dy * dy, dy * dyaw, dyaw * dyaw)
    p = [rest * one[3 + i] + share * other[3 + i] + between * squares[i] for i in range(6)]
    x, y = one.x + share * dx, one.y + share * dy
    return Hypothesis(weight, Belief(x, y, wrap_angle(one.yaw + share * dyaw), *p))
