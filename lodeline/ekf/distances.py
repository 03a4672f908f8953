"""How far each magnet was from where it should be, and from its neighbours, told afterwards.

The recorded poses are taken as they are; from one to the next the filter's own steps predict what
it expected when the reading came.
"""

from __future__ import annotations

from typing import NamedTuple

from lodeline.ekf.belief import Belief
from lodeline.ekf.history import History, Mark
from lodeline.ekf.mixture import Hypothesis
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Hits, Measurement, Sample
from lodeline.ekf.track import Track
from lodeline.ekf.tracker import Tracker


class Distance(NamedTuple):
    """Squared Mahalanobis distances of a magnet that was met, at the stamp of its first reading.

    `neighbours` are those to the eight magnets about the nearest, in no order of note.
    """

    stamp_ns: int
    nearest: float
    neighbours: tuple[float, ...]


class Distances:
    """Takes samples by stamp, of one stamp odometry first and poses last; collects distances."""

    def __init__(self, params: LocalizerParams) -> None:
        self._tracker = Tracker(params)
        self._found: dict[int, list[tuple[float, list[float]]]] = {}
        self._history: History[Track] = History(
            round(params.history * 1e9),
            Mark(0, None, self._tracker.start()),
            self._tracker.advance,
            self._observe,
        )

    def take(self, sample: Sample) -> None:
        """A sample that the filter took."""
        self._history.add(sample)

    def pose(self, stamp_ns: int, belief: Belief) -> None:
        """What the filter said after all samples up to this stamp; others are not believed."""
        mark = self._history.newest
        if mark.motion is not None and mark.stamp_ns == stamp_ns:
            track = mark.belief._replace(mixture=(Hypothesis(1.0, belief.positive()),))
            self._history.restart(Mark(stamp_ns, mark.motion, track))

    @property
    def found(self) -> list[Distance]:
        """All distances so far, in the order of their stamps."""
        _ = self._history.newest  # what came after the last pose is observed when it is asked for
        return [
            Distance(stamp_ns, nearest, tuple(others))
            for stamp_ns, distances in sorted(self._found.items())
            for nearest, others in distances
        ]

    def _observe(self, track: Track, sample: Measurement) -> Track:
        if isinstance(sample, Hits):  # told twice when the way to it is split anew: the last counts
            self._found[sample.stamp_ns] = self._tracker.distances(track, sample)
        return self._tracker.observe(track, sample)
