"""Which magnet a sight belongs to: the nearest while that is clear, else every one it may be."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lodeline.ekf.belief import Belief, made
from lodeline.ekf.engine import Detection, Engine, Innovation
from lodeline.ekf.mixture import LEAST, MOST, Hypothesis, Mixture, reduced
from lodeline.ekf.reeds import Sight
from lodeline.magnets.lattice import Lattice

DOUBT, ALARM = 3.0, 2.576  # sigmas: 99.7 and 99 % of errors are smaller
STRAY = 0.01  # share of sights that come from no magnet of the lattice
BRANCH_GATE = 16.0  # chi-square: a branch not taken never comes back, so 3 in 10 000 are refused


class Verdict(NamedTuple):
    """The mixture after a sight; `nis` None: it told nothing. `rejected`: no magnet fits it."""

    mixture: Mixture
    nis: float | None
    rejected: bool


class Association:
    """Takes a sight to a belief or to a mixture of them."""

    def __init__(
        self, engine: Engine, lattice: Lattice, bar_x: float, gate: float, bar_error: float
    ) -> None:
        """`gate` on the squared Mahalanobis distance; `bar_error`: of the bar itself [m]."""
        self._engine, self._lattice = engine, lattice
        self._bar_x, self._bar_x_squared, self._gate = bar_x, bar_x * bar_x, gate
        self._branch_gate = max(gate, BRANCH_GATE)
        # of the bar's place, when so many sigmas of it and of a sight together reach half the pitch
        self._wide, self._astray = (
            max(0.0, (0.5 * lattice.pitch / sigmas) ** 2 - bar_error**2)
            for sigmas in (DOUBT, ALARM)
        )

    def is_wide(self, belief: Belief) -> bool:
        """True if a neighbour may be meant: that is looked into, though it is unlikely."""
        return self._exceeds(belief, self._wide)

    def is_astray(self, belief: Belief, *, before: bool) -> bool:
        """True if a neighbour is meant in more than one case of a hundred: that is to be told.

        If it was so `before`, until nobody needs to look into it: it does not come and go.
        """
        return self._exceeds(belief, self._wide if before else self._astray)

    def _exceeds(self, belief: Belief, limit: float) -> bool:
        """Whether the variance [m^2] of the bar's place, along its worst axis, is above `limit`."""
        _, _, yaw, p00, p01, p02, p11, p12, p22 = belief
        if 2.0 * (p00 + p11 + self._bar_x_squared * p22) <= limit:
            return False  # even if all its parts pull the same way
        bx, by = self._bar_x * math.cos(yaw), self._bar_x * math.sin(yaw)
        c00 = p00 - 2.0 * by * p02 + by * by * p22
        c01 = p01 + bx * p02 - by * p12 - bx * by * p22
        c11 = p11 + 2.0 * bx * p12 + bx * bx * p22
        return _longest(c00, c01, c11) > limit

    def is_torn(self, belief: Belief, sights: Sequence[Sight]) -> bool:
        """True if one of these sights may be of more than one magnet."""
        if not sights or not self.is_wide(belief):
            return False
        return any(len(self._candidates(belief, sight)) > 1 for sight in sights)

    def single(self, belief: Belief, sight: Sight) -> tuple[Belief, float, bool]:
        """Belief after, Mahalanobis distance squared, and whether the gate let the sight in."""
        detection = self._nearest(belief, sight)
        nis = self._engine.weigh(belief, detection).nis
        if nis > self._gate:
            return belief, nis, False
        return self._engine.correct(belief, detection).positive(), nis, True

    def branch(self, mixture: Mixture, sight: Sight) -> Verdict:
        """Every hypothesis goes on with each magnet it may have met, and with none of them.

        A reading of a magnet that was met before does not choose anew; while a hypothesis is too
        wide to know which one that was, it tells nothing.
        """
        wide = [self.is_wide(each.belief) for each in mixture]
        if not sight.fresh and any(wide):
            return Verdict(mixture, None, rejected=False)
        # magnets lie one per cell: what a sight is worth that is taken for none of them
        area = max(
            self._lattice.pitch**2,
            2.0 * math.pi * math.sqrt(sight.ahead_variance * sight.left_variance),
        )
        children: list[Hypothesis] = []
        taken = strays = flat = 0.0
        best = math.inf
        for (weight, belief), is_wide in zip(mixture, wide, strict=True):
            seen = self._candidates(belief, sight) if is_wide else [self._nearest(belief, sight)]
            if len(seen) > MOST:  # it may be anywhere: no magnet tells it more
                children.append(Hypothesis(weight / area, belief))
                flat += weight / area
                continue
            children.append(Hypothesis(STRAY * weight / area, belief))
            strays += STRAY * weight / area
            for detection in seen:
                innovation = self._engine.weigh(belief, detection)
                best = min(best, innovation.nis)
                if innovation.nis > self._branch_gate:
                    continue
                likely = weight * _density(innovation, detection)
                taken += likely
                after = self._engine.correct(belief, detection).positive()
                children.append(Hypothesis(likely, after))
        if best == math.inf:
            return Verdict(mixture, None, rejected=False)
        return Verdict(reduced(children), best, rejected=strays > taken + flat)

    def distances(self, belief: Belief, sight: Sight) -> tuple[float, list[float]]:
        """Squared Mahalanobis distances of a sight: to the nearest magnet, and to those about it.

        These are the eight other corners and edges of the square of two pitches around it.
        """
        nearest = self._nearest(belief, sight)
        at = nearest.magnet_x, nearest.magnet_y
        others = (
            self._detection(sight, magnet)
            for magnet in self._lattice.around(*at, 1.5 * self._lattice.pitch)
            if math.dist(magnet, at) > 0.5 * self._lattice.pitch
        )
        weigh = self._engine.weigh
        return weigh(belief, nearest).nis, [weigh(belief, each).nis for each in others]

    def _nearest(self, belief: Belief, sight: Sight) -> Detection:
        return self._detection(sight, self._lattice.nearest(*self._spot(belief, sight)))

    def _candidates(self, belief: Belief, sight: Sight) -> list[Detection]:
        """The nearest magnet and all others that may be meant, or more than `MOST`.

        A wide gate lets in no more of them than have a weight beside the nearest.
        """
        nearest = self._nearest(belief, sight)
        s = self._engine.weigh(belief, nearest)
        gate = max(BRANCH_GATE, min(self._gate, s.nis - 2.0 * math.log(LEAST)))
        radius = math.sqrt(gate * _longest(s.s00, s.s01, s.s11))
        if math.pi * radius * radius > 4.0 * MOST * self._lattice.pitch**2:
            return [nearest] * (MOST + 1)
        detections = (
            self._detection(sight, magnet)
            for magnet in self._lattice.around(*self._spot(belief, sight), radius)
        )
        return [each for each in detections if self._engine.weigh(belief, each).nis <= gate]

    def _spot(self, belief: Belief, sight: Sight) -> tuple[float, float]:
        """Where a belief puts the magnet that was seen [m]."""
        ahead, lateral = self._bar_x + sight.offset, sight.lateral
        c, s = math.cos(belief.yaw), math.sin(belief.yaw)
        return belief.x + c * ahead - s * lateral, belief.y + s * ahead + c * lateral

    def _detection(self, sight: Sight, magnet: tuple[float, float]) -> Detection:
        lateral, offset, ahead_variance, left_variance, _ = sight
        variances = ahead_variance, left_variance
        return made(Detection, (self._bar_x + offset, lateral, *variances, *magnet))


def _longest(c00: float, c01: float, c11: float) -> float:
    """The larger eigenvalue of a symmetric 2x2 matrix."""
    return 0.5 * (c00 + c11) + math.hypot(0.5 * (c00 - c11), c01)


def _density(innovation: Innovation, detection: Detection) -> float:
    """Likelihood [1/m^2] of a detection: the normal density of its innovation."""
    _, _, s00, s01, s11, nis = innovation
    det = max(s00 * s11 - s01 * s01, detection.ahead_variance * detection.left_variance)
    return math.exp(-0.5 * nis) / (2.0 * math.pi * math.sqrt(det))
