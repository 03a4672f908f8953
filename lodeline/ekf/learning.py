"""The tracker and the mover that learn constants of the robot on the way (see `learned`).

They stand beside those that do not, so that a robot whose constants are known pays nothing. While
several magnets may be meant, nothing is learned.
"""

from lodeline.ekf import learned
from lodeline.ekf.agreement import Agreement
from lodeline.ekf.engine import Engine, Noise
from lodeline.ekf.gyro import Turn
from lodeline.ekf.learned import Learned
from lodeline.ekf.mixture import Hypothesis
from lodeline.ekf.motion import Delta, part, twist
from lodeline.ekf.mover import Mover, Way
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Measurement, Motion
from lodeline.ekf.track import Track
from lodeline.ekf.tracker import Tracker


class LearningMover(Mover):
    """Steps by wheels and gyro as they are believed to be."""

    def __init__(self, engine: Engine, params: LocalizerParams) -> None:
        super().__init__(engine, params)
        self._known = learned.start(0.0, 0.0, 0.0)
        self._by_gyro = 0.0  # share of the last turn that the gyro has decided

    def advance(
        self,
        track: Track,
        before: Motion,
        after: Motion,
        from_ns: int,
        to_ns: int,
        gyro: Turn | None,
    ) -> Track:
        """After a part of a motion; the pose less sure by what the constants may be wrong by."""
        assert track.learned is not None
        self._known, self._by_gyro, self._last = track.learned, 0.0, None
        there = super().advance(track, before, after, from_ns, to_ns, gyro)
        way = self._way(before, after)
        if way.jumped:
            return there._replace(learned=track.learned.alone())
        share, by_gyro = (to_ns - from_ns) / way.gap_ns, self._by_gyro
        wheels = (1.0 - by_gyro) * share * way.delta.turn / (1.0 + track.learned.turn)
        seconds, mixture, found = share * way.seconds, [], track.learned
        for old, new in reversed(list(zip(track.mixture, there.mixture, strict=True))):
            found, belief = learned.moved(
                track.learned, old.belief, new.belief, wheels, by_gyro * seconds, seconds
            )
            mixture.append(Hypothesis(new.weight, belief.positive()))
        return there._replace(mixture=tuple(reversed(mixture)), learned=found)

    def _way(self, before: Motion, after: Motion) -> Way:
        way, known = super()._way(before, after), self._known
        if way.jumped:
            return way
        ahead, left, turn = twist(way.delta)
        longer = Delta(
            (1.0 + known.way) * ahead, (1.0 + known.way) * left, (1.0 + known.turn) * turn
        )
        return way._replace(twist=longer, delta=part(longer, 1.0))

    def _with_gyro(
        self, before: Agreement, delta: Delta, noise: Noise, turn: Turn, seconds: float
    ) -> tuple[Agreement, Delta, Noise]:
        turn = turn._replace(angle=turn.angle - self._known.bias * seconds)
        agreement, delta, noise = super()._with_gyro(before, delta, noise, turn, seconds)
        if turn.variance > 0.0:
            self._by_gyro = noise.tt / turn.variance
        return agreement, delta, noise


class LearningTracker(Tracker):
    """Steps that keep `learned` of the track."""

    def __init__(self, params: LocalizerParams) -> None:
        super().__init__(params)
        self._mover = LearningMover(self._engine, params)

    def start(self) -> Track:
        """The track before any sample."""
        known = learned.start(*self._params.wheel_sigma, self._params.gyro_bias_sigma)
        return super().start()._replace(learned=known)

    def advance(
        self, track: Track, before: Motion, after: Motion, from_ns: int, to_ns: int
    ) -> Track:
        """After a part of a motion; a robot that was lifted meanwhile may be anywhere."""
        there, known = super().advance(track, before, after, from_ns, to_ns), track.learned
        if known is None or there.trust.alarms == track.trust.alarms:
            return there
        return there._replace(learned=known.alone())

    def lost(self, track: Track) -> Track:
        """After a moment at which nobody knows where the robot went."""
        there = super().lost(track)
        return there._replace(learned=track.learned and track.learned.alone())

    def observe(self, track: Track, sample: Measurement) -> Track:
        """After a sample that is no motion: what it said of the pose it says of the constants."""
        there, known = super().observe(track, sample), track.learned
        if there.mixture is track.mixture or known is None:
            return there
        return there._replace(learned=self._told(known, track, there))

    @staticmethod
    def _told(known: Learned, track: Track, there: Track) -> Learned:
        if track.torn or there.torn or track.trust.alarms != there.trust.alarms:
            return known.alone()
        before, after = track.belief, there.belief
        if before.p00 + before.p11 < after.p00 + after.p11:  # it was widened
            return known.alone()
        return learned.corrected(known, before, after)
