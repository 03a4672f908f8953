"""One EKF step after the other: what each kind of sample does to the track."""

from lodeline.ekf.association import Association
from lodeline.ekf.bar import Bar
from lodeline.ekf.belief import Belief, certain
from lodeline.ekf.compass import Compass
from lodeline.ekf.engines import make_engine
from lodeline.ekf.gyro import Gyro
from lodeline.ekf.landmarks import sighted
from lodeline.ekf.mixture import Hypothesis, certainty, spread
from lodeline.ekf.mover import Mover
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Fix, Heading, Hits, Measurement, Motion
from lodeline.ekf.track import Track
from lodeline.magnets.lattice import Lattice

LONGEST_NS = 50_000_000  # of one step: in so little time no turn bends a way that one can measure
MOVED_SIGMA = (1.0, 1.0)  # m, rad: what is told of a robot that was moved by someone else


class Tracker:
    """Steps from track to track; the history calls them in the order of stamps.

    They depend on the track, the sample and what the `gyro` was told, and change none of them.
    """

    def __init__(self, params: LocalizerParams) -> None:
        self._params, self._blind = params, params.magnet_model == "none"
        self._engine = engine = make_engine(params.engine)
        lattice = Lattice(params.cell, *params.lattice_origin)
        self._association = Association(
            engine, lattice, params.bar_x, params.gate, params.bar_error
        )
        self.gyro = Gyro(params.gyro_noise**2, params.wander[1] ** 2)
        self._mover = Mover(engine, params)
        self._bar, self._compass = Bar(self._association, params), Compass(engine, params)

    def start(self) -> Track:
        """The track before any sample."""
        params = self._params
        belief = certain(*params.initial_pose).widened(*params.initial_sigma)
        return Track((Hypothesis(1.0, belief),), wide=self._association.is_wide(belief))

    def advance(
        self, track: Track, before: Motion, after: Motion, from_ns: int, to_ns: int
    ) -> Track:
        """After a part of a motion: see `Mover.advance`.

        A long one is taken in pieces, for the way bends as the gyro saw it.
        """
        turn, cut_ns = self.gyro.over(from_ns, to_ns), None
        if turn is None:
            cut_ns = self.gyro.seam(from_ns, to_ns)
        elif to_ns - from_ns > LONGEST_NS:
            cut_ns = (from_ns + to_ns) // 2
        if cut_ns is not None:
            track = self.advance(track, before, after, from_ns, cut_ns)
            return self.advance(track, before, after, cut_ns, to_ns)
        track = self._mover.advance(track, before, after, from_ns, to_ns, turn)
        lift, was_lifted = self.gyro.lifted(from_ns, to_ns)
        if lift is not track.lift:
            track = track._replace(lift=lift)
        return self.marked(track.alarmed(*self._params.widen_sigma) if was_lifted else track)

    def lost(self, track: Track) -> Track:
        """After a moment at which nobody knows where the robot went."""
        return self.marked(self._mover.lost(track))

    def observe(self, track: Track, sample: Measurement) -> Track:
        """After a sample that is no motion."""
        if isinstance(sample, Hits):
            after = track if self._blind else self._bar.read(track, sample)
        elif isinstance(sample, Heading):
            after = self._compass.read(track, sample)
        else:
            after = track
            for landmark in (sample,) if isinstance(sample, Fix) else sample.seen:
                after = sighted(self._engine, after, landmark)
        return after if after.mixture is track.mixture else self.marked(after)

    def distances(self, track: Track, hits: Hits) -> list[tuple[float, list[float]]]:
        """How a reading tells magnets apart, before any of them corrects: see `Bar.distances`."""
        return self._bar.distances(track, hits)

    def has_stuck_reed(self, track: Track) -> bool:
        """True while a reed stays closed farther than any magnet holds it."""
        return self._bar.has_stuck_reed(track)

    def published(self, track: Track) -> tuple[Belief, float, bool]:
        """The pose with all that it may be wrong by, how certain its cell is, and `ambiguous`.

        After an alarm it goes on as well as it can, but which cell of the lattice it is in no
        magnet tells: it is not trusted again.
        """
        mixture, sure = track.mixture, 1.0
        belief = mixture[0].belief
        if len(mixture) > 1:
            belief, sure = spread(mixture), certainty(mixture, self._params.cell)
        if track.trust.alarms:
            return belief.widened(*MOVED_SIGMA), 0.0, True
        return belief, sure, track.wide or sure < self._params.sure

    def marked(self, track: Track) -> Track:
        """With `wide` as it is now."""
        (_, belief), wide = track.mixture[0], track.wide
        after = self._association.is_astray(belief, before=wide)
        return track if after == wide else track._replace(wide=after)
