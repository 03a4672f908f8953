"""One EKF step after the other: what a motion and a reading of the bar do to the belief."""

import math
from typing import NamedTuple

from lodeline.ekf.association import Association
from lodeline.ekf.belief import Belief, certain
from lodeline.ekf.engine import Noise, make_engine
from lodeline.ekf.history import Hits, Motion
from lodeline.ekf.mixture import Hypothesis, Mixture, certainty, spread
from lodeline.ekf.motion import Delta, part, relative
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.sightings import (
    UNKNOWN_WAY,
    Contact,
    ReedModel,
    Sight,
    edge_sights,
    plain_sights,
)
from lodeline.magnets.lattice import Lattice

COAST = 1.0  # s: for so long a robot that nobody measures is taken to go on as it went
RECENT = 8  # sights of which too many must not be rejected


class Track(NamedTuple):
    """What is carried from sample to sample: the beliefs and the marks of their detections.

    `belief` is the leading hypothesis; `others` are there while it is not clear which one is true.
    """

    belief: Belief
    contacts: tuple[Contact, ...] = ()
    way: float = UNKNOWN_WAY  # of the bar since the last reading of it [m]
    step: float = 0.0  # the part of it along x, signed [m]
    nis: float = 0.0
    rejected: int = 0
    recent: int = 0  # one bit for each of the last sights, newest lowest: 1 was rejected
    alarms: int = 0  # times that too many of them were
    v: float = 0.0  # how fast it went last [m/s]
    w: float = 0.0  # and turned [rad/s]
    blind: bool = False  # in the midst of a way that nobody measures
    weight: float = 1.0
    others: Mixture = ()

    @property
    def mixture(self) -> Mixture:
        """All hypotheses, the leading one first."""
        return (Hypothesis(self.weight, self.belief), *self.others)

    def of(self, mixture: Mixture) -> "Track":
        """The same with another mixture."""
        (weight, belief), *others = mixture
        return self._replace(belief=belief, weight=weight, others=tuple(others))

    def widened(self, position: float, heading: float) -> "Track":
        """Every hypothesis less sure by these standard deviations [m, rad]."""
        wide = (Hypothesis(w, b.widened(position, heading)) for w, b in self.mixture)
        return self.of(tuple(wide))


class Tracker:
    """Pure steps from track to track; the history calls them in the order of stamps."""

    def __init__(self, params: LocalizerParams) -> None:
        self._params = params
        self._engine = make_engine(params.engine)
        self._reeds = ReedModel(params.passage, params.edge_sigma, params.lateral_sigma)
        self._association = Association(
            self._engine,
            Lattice(params.lattice_pitch, *params.lattice_origin),
            params.bar_x,
            params.gate,
            params.bar_error,
        )

    def start(self) -> Track:
        """The track before any sample."""
        params = self._params
        return Track(certain(*params.initial_pose).widened(*params.initial_sigma))

    def lost(self, track: Track, seconds: float = 0.0, share: float = 1.0) -> Track:
        """After `seconds` in which nobody measured where the robot went, or a `share` of a gap.

        It is taken to have gone on as it went; that it stopped at once is one sigma off.
        """
        position, heading = self._params.reset_sigma
        reach = min(seconds, COAST * share)
        delta = _arc(track.v * reach, track.w * reach)
        # of a gap in several parts each brings its share of the variance of the whole
        along, turn = track.v * seconds, track.w * seconds
        noise = Noise(
            along * along / share,
            0.0,
            turn * turn / share,
            share * position * position,
            share * heading * heading,
        )
        track = self._moved(track, delta, noise)
        return track._replace(contacts=(), way=UNKNOWN_WAY, step=0.0)

    def advance(
        self, track: Track, before: Motion, after: Motion, begin: float, end: float
    ) -> Track:
        """After the part from `begin` to `end` (fractions) of the motion between two samples."""
        params, share = self._params, end - begin
        seconds = (after.stamp_ns - before.stamp_ns) * 1e-9
        delta = relative(before.x, before.y, before.yaw, after.x, after.y, after.yaw)
        if after.resets != before.resets or (
            math.hypot(delta.ahead, delta.left) > params.max_speed * seconds
        ):
            track = self.lost(track, seconds * share, share)
            return track._replace(blind=end < 1.0)
        v, w = delta.ahead / seconds, delta.turn / seconds
        if share < 1.0:
            delta = part(delta, begin, end)
        track = self._moved(track, delta, self._noise(after, seconds * share))
        way = math.hypot(delta.ahead, delta.left + params.bar_x * delta.turn)
        way, step = track.way + way, track.step + delta.ahead
        return track._replace(way=way, step=step, v=v, w=w, blind=False)

    def _moved(self, track: Track, delta: Delta, noise: Noise) -> Track:
        predict = self._engine.predict
        if not track.others:
            return track._replace(belief=predict(track.belief, delta, noise))
        return track.of(tuple(Hypothesis(w, predict(b, delta, noise)) for w, b in track.mixture))

    def _noise(self, motion: Motion, seconds: float) -> Noise:
        if self._params.process_noise == "alpha":
            steps = seconds / motion.interval if motion.interval > 0.0 else 1.0
            position, heading = self._params.alpha_sigma
            return Noise(0.0, 0.0, 0.0, steps * position**2, steps * heading**2)
        # white in time: what the twist's covariance is worth over `interval`, for `seconds`
        vv, vw, _, ww = motion.twist_covariance
        scale = motion.interval * seconds
        return Noise(scale * vv, scale * vw, scale * ww)

    def observe(self, track: Track, hits: Hits) -> Track:
        """After a reading of the bar: each sight is gated, then corrects the belief."""
        if track.blind:  # a magnet that stays or another one? it tells more when the gap is over
            return track
        contacts: tuple[Contact, ...] = ()
        sights = plain_sights(self._reeds, hits.laterals) if hits.laterals else []
        torn = bool(track.others) or (
            self._params.association == "mixture"
            and self._association.is_torn(track.belief, sights)
        )
        if self._params.magnet_model == "edges":
            sights, contacts = edge_sights(
                self._reeds, track.contacts, hits.laterals, track.way, track.step, sharp=torn
            )
        alarms = track.alarms
        for sight in sights:
            track = self._detect(track, sight, torn=torn)
        if track.alarms != alarms:
            contacts = ()  # which magnets these were is open again
        return track._replace(contacts=contacts, way=0.0, step=0.0)

    def _detect(self, track: Track, sight: Sight, *, torn: bool) -> Track:
        if not torn:
            # a reed that opens tells nothing across, but which magnet it was must be clear there
            nominal = self._reeds.sight(sight.lateral, sight.offset, sight.offset)
            if not sight.fresh and self._association.is_torn(track.belief, (nominal,)):
                return track
            belief, nis, passed = self._association.single(track.belief, sight)
            return self._judged(track._replace(belief=belief), nis, rejected=not passed)
        mixture, distance, rejected = self._association.branch(track.mixture, sight)
        if distance is None:
            return track
        return self._judged(track.of(mixture), distance, rejected=rejected)

    def _judged(self, track: Track, nis: float, *, rejected: bool) -> Track:
        """Counts a verdict; too many rejections among the last mean that the pose is wrong."""
        if not rejected and not track.recent:
            return track._replace(nis=nis)
        recent = (track.recent << 1 | rejected) & ((1 << RECENT) - 1)
        track = track._replace(nis=nis, rejected=track.rejected + rejected, recent=recent)
        if recent.bit_count() < self._params.widen_after:
            return track
        track = track._replace(recent=0, alarms=track.alarms + 1)
        return track.widened(*self._params.widen_sigma)

    def published(self, track: Track) -> tuple[Belief, float, bool]:
        """The pose with all that it may be wrong by, how certain its cell is, and `ambiguous`."""
        if not track.others:
            return track.belief, 1.0, self._association.is_wide(track.belief)
        mixture = track.mixture
        sure = certainty(mixture, self._params.lattice_pitch)
        wide = self._association.is_wide(track.belief)
        return spread(mixture), sure, wide or sure < self._params.sure


def _arc(way: float, turn: float) -> Delta:
    """The motion of `way` [m] along an arc that turns by `turn` [rad]."""
    chord = way * (math.sin(0.5 * turn) / (0.5 * turn) if abs(turn) > 1e-9 else 1.0)
    return Delta(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn)
