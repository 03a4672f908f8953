"""What a reading of the reed bar says about where the magnets lie ahead of the robot.

A magnet holds its reed closed over a stretch of the way, the passage. A closed reed alone says
only that the magnet is somewhere in it (`plain_sights`). A reed that was open one reading ago
closed within the last step, so the magnet is at the near end of the passage; one that opens again
leaves it at the far end. Across, all readings of a passage have one error in common, so each is
worth its share of the way, and all of them one sight. Ahead, one in between tells only that the
magnet did not leave within the last step: a share of that share, next to nothing where steps are
short (`edge_sights`).

Where a sight has to tell one magnet from the next (`sharp`), shares are too faint to choose by: the
first reading of a magnet is then worth the passage as a whole, and the others of it nothing.
"""

from typing import NamedTuple

from lodeline.ekf.belief import made

UNKNOWN_WAY = 1e3  # m: the bar may have come from anywhere
SAME_MAGNET = 0.011  # m: magnets are farther apart than a sight moves within a passage
STUCK = 2.0  # passages: a reed that stays closed for longer has no magnet under it
ANYWHERE = 1.0  # m^2: variance across of a magnet that is no longer under any reed
NOTHING = 1e-6  # share of a passage
STRAIGHT = 0.8  # share of the bar's way along its x axis from which there is a near and a far end


class Sight(NamedTuple):
    """A magnet at (bar_x + `offset`, `lateral`) [m] of the robot, with variances [m^2]."""

    lateral: float
    offset: float
    ahead_variance: float
    left_variance: float
    fresh: bool = True  # not of a magnet that a reading before this one had


class Contact(NamedTuple):
    """A magnet met lately: last lateral offset and the bar's ways since, all in m."""

    lateral: float
    since_first: float  # signed, along x, since the first reading that had it
    since_last: float  # any direction, since the last reading that had it
    told: float = 0.0  # share of a passage that its readings are worth so far

    def moved(self, way: float, step: float) -> "Contact":
        """After the bar moved by `way` [m], of which `step` along x."""
        lateral, first, last, told = self
        return made(Contact, (lateral, first + step, last + way, told))


class BarMemory(NamedTuple):
    """The magnets met lately, and what the bar moved since it was read last.

    `way` [m] in any direction, `step` the part of it along x, signed.
    """

    contacts: tuple[Contact, ...] = ()
    way: float = UNKNOWN_WAY
    step: float = 0.0

    def moved(self, way: float, step: float) -> "BarMemory":
        """After the bar moved by `way` [m], of which `step` along x."""
        contacts, before, step_before = self
        return made(BarMemory, (contacts, before + way, step_before + step))


class ReedModel(NamedTuple):
    """Length of the passage, scatter of its two ends, and scatter across [m]."""

    passage: float
    edge_sigma: float
    lateral_sigma: float

    def sight(
        self,
        lateral: float,
        low: float,
        high: float,
        ahead_share: float = 1.0,
        share: float = 1.0,
        *,
        fresh: bool = True,
    ) -> Sight:
        """A magnet anywhere from `low` to `high` [m] ahead of the bar; worth shares of a sight."""
        ahead = ((high - low) ** 2 / 12.0 + self.edge_sigma**2) / ahead_share
        left = self.lateral_sigma**2 / share
        return made(Sight, (lateral, 0.5 * (low + high), ahead, left, fresh))


def plain_sights(model: ReedModel, laterals: tuple[float, ...]) -> list[Sight]:
    """Each magnet of each reading is under the bar, give or take half a passage."""
    half = 0.5 * model.passage
    return [model.sight(lateral, -half, half) for lateral in laterals]


def edge_sights(
    model: ReedModel, memory: BarMemory, laterals: tuple[float, ...], *, sharp: bool = False
) -> tuple[list[Sight], tuple[Contact, ...]]:
    """Sights of a reading, and the contacts to remember for the next.

    The contacts in `memory` are those of the reading before, not yet moved.
    """
    contacts, way, step = memory.contacts, memory.way, memory.step
    half, straight = 0.5 * model.passage, abs(step) >= STRAIGHT * way > 0.0
    share = min(1.0, max(way, NOTHING) / model.passage)
    sights: list[Sight] = []
    kept: list[Contact] = []
    left_over = list(contacts)
    for lateral in laterals:
        before = _nearest(left_over, lateral)
        low, high = -half, half
        if before is None:
            worth = 1.0 if sharp else share
            ahead_share = worth
            kept.append(Contact(lateral, 0.0, 0.0, worth))
            if straight:  # it came in at the near end, within the last step
                ahead_share = 1.0
                if step > 0.0:
                    low = max(-half, half - step)
                else:
                    high = min(half, -half - step)
        else:
            left_over.remove(before)
            worth = max(0.0, min(share, 1.0 - before.told))
            ahead_share = share * share if straight else worth
            since_first = before.since_first + step
            kept.append(Contact(lateral, since_first, 0.0, before.told + share))
            if worth < NOTHING or abs(since_first) > STUCK * model.passage:
                continue
        fresh = before is None
        sights.append(model.sight(lateral, low, high, ahead_share, worth, fresh=fresh))
    for before in left_over:
        moved = before.moved(way, step)
        closed = before.since_last == 0.0
        # it went through, rather than back out, if the bar is well past where it met the magnet
        through = moved.since_first
        if not half <= abs(through) <= STUCK * model.passage:
            through = 0.0
        if closed and straight and way < model.passage and through * step > 0.0:
            low, high = (-half - step, -half) if step > 0.0 else (half, half - step)
            sight = model.sight(before.lateral, low, high)
            sights.append(sight._replace(left_variance=ANYWHERE, fresh=False))
        if moved.since_last < model.passage:
            kept.append(moved)
    return sights, tuple(kept)


def _nearest(contacts: list[Contact], lateral: float) -> Contact | None:
    near = [each for each in contacts if abs(each.lateral - lateral) <= SAME_MAGNET]
    return min(near, key=lambda each: abs(each.lateral - lateral), default=None)
