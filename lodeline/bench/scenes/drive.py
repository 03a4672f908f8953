"""A simulated drive over the magnets, at the level of counts and reeds: small, fast, and seeded.

The robot errs by what its estimators are told: each wheel's way has a variance that grows with the
way, each passage over a magnet has ends and an offset of its own. Or, with a `reach`, its bar is
one of eight reeds, each closed by any magnet so near to it.
"""

import math
from random import Random

from lodeline.ekf import LocalizerParams
from lodeline.magnets import ReedBar, ReedBarParams
from lodeline.odometry import OdometryParams

NEAR = 0.03  # m: a magnet farther ahead of the bar than this is forgotten
HALF_BAR = 0.038  # m: reach of the reeds to each side
BAR = ReedBarParams()
Pose = tuple[float, float, float]


class Drive:
    """A robot with noisy wheels on the lattice of `params`; truth is `x`, `y`, `yaw`.

    `missing` of the magnets are not there and `moved` of them lie `moved_by` [m] aside, the same
    ones whenever the robot comes by.
    """

    def __init__(
        self,
        rng: Random,
        params: LocalizerParams,
        wheels: OdometryParams,
        *,
        missing: float = 0.0,
        moved: float = 0.0,
        moved_by: float = 0.010,
        reach: float | None = None,
    ) -> None:
        self._rng, self._params, self._wheels = rng, params, wheels
        position, heading = params.initial_sigma
        x, y, yaw = params.initial_pose
        self.x, self.y = x + rng.gauss(0, position), y + rng.gauss(0, position)
        self.yaw = yaw + rng.gauss(0, heading)
        self._left = self._right = 0.0
        self._scatters: dict[tuple[int, int], Pose] = {}
        self._missing, self._moved, self._moved_by = missing, moved, moved_by
        self._salt, self._reach = rng.getrandbits(32), reach

    def go(self, way: float, turn: float) -> None:
        """Wheels that mean to go `way` [m] and turn by `turn` [rad], and what comes of it."""
        rng, drive, k = self._rng, self._wheels.drive, self._wheels.distance_noise
        left, right = drive.wheels(way, turn)
        ds, dtheta = drive.motion(
            left + rng.gauss(0, math.sqrt(k * abs(left))),
            right + rng.gauss(0, math.sqrt(k * abs(right))),
        )
        self._left, self._right = self._left + left, self._right + right
        self.slide(ds * math.cos(0.5 * dtheta), ds * math.sin(0.5 * dtheta), dtheta)

    def slide(self, ahead: float, left: float, turn: float) -> None:
        """A motion [m, m, rad] that no wheel measures."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        self.x += c * ahead - s * left
        self.y += s * ahead + c * left
        self.yaw += turn

    def counts(self) -> tuple[int, int]:
        """Cumulative counts of the two encoders."""
        tick = self._wheels.drive.metres_per_tick
        return round(self._left / tick), round(self._right / tick)

    def laterals(self) -> tuple[float, ...]:
        """Offsets [m] of the magnets under the bar, from right to left."""
        params = self._params
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        pitch, half = params.lattice_pitch, 0.5 * params.passage
        at_i = round((self.x + c * params.bar_x) / pitch)
        at_j = round((self.y + s * params.bar_x) / pitch)
        seen: list[float] = []
        closed, known = 0, self._scatters
        self._scatters = {}
        for i in (at_i - 1, at_i, at_i + 1):
            for j in (at_j - 1, at_j, at_j + 1):
                place = self._magnet(i, j)
                if place is None:
                    continue
                dx, dy = place[0] - self.x, place[1] - self.y
                ahead, left = c * dx + s * dy - params.bar_x, c * dy - s * dx
                if self._reach is not None:
                    closed |= _closed(ahead, left, self._reach)
                    continue
                if abs(left) > HALF_BAR or abs(ahead) > NEAR:
                    continue
                first, last, across = known.get((i, j)) or self._scatter()
                self._scatters[i, j] = first, last, across
                if -half + first <= ahead <= half + last:
                    seen.append(left + across)
        return ReedBar(BAR).laterals(closed) if closed else tuple(sorted(seen))

    def _magnet(self, i: int, j: int) -> tuple[float, float] | None:
        """Where the magnet (i, j) truly lies [m], if it does."""
        pitch = self._params.lattice_pitch
        if not (self._missing or self._moved):
            return pitch * i, pitch * j
        fate = Random(hash((self._salt, i, j)))
        if fate.random() < self._missing:
            return None
        if fate.random() >= self._moved:
            return pitch * i, pitch * j
        aside = fate.uniform(-math.pi, math.pi)
        by = self._moved_by
        return pitch * i + by * math.cos(aside), pitch * j + by * math.sin(aside)

    def _scatter(self) -> Pose:
        edge, across = self._params.edge_sigma, self._params.lateral_sigma
        return self._rng.gauss(0, edge), self._rng.gauss(0, edge), self._rng.gauss(0, across)


def _closed(ahead: float, left: float, reach: float) -> int:
    """The reeds that a magnet so far from the middle of the bar closes: bit 0 is the rightmost."""
    word = 0
    for i in range(BAR.reeds):
        across = left - BAR.pitch * (i - 0.5 * (BAR.reeds - 1))
        word |= (math.hypot(ahead, across) < reach) << i
    return word
