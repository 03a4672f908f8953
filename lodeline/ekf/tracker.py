"""One EKF step after the other: what a motion and a reading of the bar do to the belief."""

import math
from typing import NamedTuple

from lodeline.ekf.association import Association
from lodeline.ekf.belief import Belief, certain
from lodeline.ekf.engine import Noise, make_engine
from lodeline.ekf.history import Hits, Landmarks, Motion, Spin
from lodeline.ekf.landmarks import GATES, STRAY, Landmark, corrected, numbers, weighed
from lodeline.ekf.mixture import Hypothesis, Mixture, certainty, reduced, spread
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
from lodeline.ekf.turning import RATE_LIFE, Agreement, compared, doubting, fused
from lodeline.magnets.lattice import Lattice
from lodeline.rotation import wrap_angle

COAST = 1.0  # s: for so long a robot that nobody measures is taken to go on as it went
TILT, TILT_TIME_NS = 0.17, 300_000_000  # rad and ns: no floor does that, a hand does
MOVED_SIGMA = (1.0, 1.0)  # m, rad: what is told of a robot that was moved by someone else
MISSED_SIGMA = (0.3, 0.1)  # m, rad: more doubt after eight landmarks in a row that did not fit
SWING, SPIKE = 100.0, 0.5  # rad/s^2 and rad/s: no robot changes its turn faster than by this
STUCK_PITCHES = 3.0  # a reed that stays closed over so much of the lattice is stuck
HEADING_GATE = 6.63  # 99 % of chi-square, 1 degree of freedom
RECENT = 8  # sights of which too many must not be rejected


LONG_AGO = -(1 << 63)


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
    rate: float = 0.0  # of turn, by the gyro [rad/s]
    rate_ns: int = LONG_AGO
    spiked: bool = False  # the last reading of it was not believed
    heading_ns: int = LONG_AGO  # when a heading was used last
    agreement: Agreement = Agreement()
    tilted_ns: int = LONG_AGO  # since when, or not at all
    lifted: bool = False
    streak: int = 0  # landmarks in a row that fitted; negative, that did not

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

    def lost(
        self,
        track: Track,
        seconds: float = 0.0,
        share: float = 1.0,
        gyro: float | None = None,
    ) -> Track:
        """After `seconds` in which nobody measured where the robot went, or a `share` of a gap.

        It is taken to have gone on as it went; that it stopped at once is one sigma off. `gyro`
        is the turn that the gyro saw [rad].
        """
        position, heading = self._params.reset_sigma
        reach = min(seconds, COAST * share)
        # of a gap in several parts each brings its share of the variance of the whole
        along, turn = track.v * seconds, track.w * seconds
        tt, doubt = turn * turn / share, share * heading * heading
        if gyro is None:
            delta = _arc(track.v * reach, track.w * reach)
        else:
            delta = _arc(track.v * reach, gyro)
            tt, doubt = self._gyro_variance(seconds), 0.0
        noise = Noise(along * along / share, 0.0, tt, share * position * position, doubt)
        track = self._moved(track, delta, noise)
        return track._replace(contacts=(), way=UNKNOWN_WAY, step=0.0)

    def advance(
        self, track: Track, before: Motion, after: Motion, begin: float, end: float
    ) -> Track:
        """After the part from `begin` to `end` (fractions) of the motion between two samples."""
        params, share = self._params, end - begin
        gap_ns = after.stamp_ns - before.stamp_ns
        seconds = gap_ns * 1e-9
        delta = relative(before.x, before.y, before.yaw, after.x, after.y, after.yaw)
        age = 1e-9 * (before.stamp_ns + begin * gap_ns - track.rate_ns)
        gyro = track.rate * seconds * share if age <= RATE_LIFE else None
        if after.resets != before.resets or (
            math.hypot(delta.ahead, delta.left) > params.max_speed * seconds
        ):
            track = self.lost(track, seconds * share, share, gyro)
            return track._replace(blind=end < 1.0)
        v, w = delta.ahead / seconds, delta.turn / seconds
        if share < 1.0:
            delta = part(delta, begin, end)
        noise = self._noise(after, seconds * share)
        if gyro is not None:
            track, delta, noise = self._with_gyro(track, delta, noise, gyro, seconds * share)
        track = self._moved(track, delta, noise)
        way = math.hypot(delta.ahead, delta.left + params.bar_x * delta.turn)
        way, step = track.way + way, track.step + delta.ahead
        return track._replace(way=way, step=step, v=v, w=w, blind=False)

    def _with_gyro(
        self, track: Track, delta: Delta, noise: Noise, turn: float, seconds: float
    ) -> tuple[Track, Delta, Noise]:
        """The step as wheels and gyro see it together; where they differ too much, the gyro."""
        off, variance = turn - delta.turn, self._gyro_variance(seconds)
        doubted = track.agreement.doubted
        agreement = compared(track.agreement, off, noise.tt + variance, seconds)
        if doubted or agreement.doubted:
            noise = doubting(noise, off, agreement, seconds, self._params.track)
        delta, noise = fused(delta, noise, turn, variance)
        return track._replace(agreement=agreement), delta, noise

    def _gyro_variance(self, seconds: float) -> float:
        return self._params.gyro_noise**2 * seconds

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

    def observe(self, track: Track, sample: Hits | Spin | Landmarks) -> Track:
        """After a sample that is no motion."""
        if isinstance(sample, Spin):
            return self._spun(track, sample)
        if isinstance(sample, Landmarks):
            for landmark in sample.seen:
                track = self._sighted(track, landmark)
            return track
        return self._read(track, sample)

    def _spun(self, track: Track, spin: Spin) -> Track:
        """From here on the robot turns as the gyro says; now and then, its heading is north's."""
        track = _turning(self._tilted(track, spin), spin)
        params = self._params
        wait_ns = params.heading_interval * 1e9
        if params.heading == "off" or spin.stamp_ns - track.heading_ns < wait_ns:
            return track
        if not math.isfinite(spin.heading_sigma):
            return track
        variance = spin.heading_sigma**2 + params.heading_sigma**2
        headed = []
        for weight, belief in track.mixture:
            off = wrap_angle(spin.heading - belief.yaw)
            if off * off > HEADING_GATE * (belief.p22 + variance):
                return track
            after = self._engine.correct_scalar(belief, (0.0, 0.0, 1.0), off, variance)
            headed.append(Hypothesis(weight, after.positive()))
        return track.of(tuple(headed))._replace(heading_ns=spin.stamp_ns)

    def _sighted(self, track: Track, landmark: Landmark) -> Track:
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
            after = corrected(self._engine, belief, seen)
            children.append(Hypothesis(weight * max(likely, STRAY), after))
        if not fits:
            streak = min(track.streak, 0) - 1
            track = track._replace(nis=nis, rejected=track.rejected + 1, streak=streak)
            if streak > -RECENT:
                return track
            return track._replace(streak=0).widened(*MISSED_SIGMA)
        streak = max(track.streak, 0) + 1
        # landmarks are no lattice: enough of them say where a robot is that was moved
        alarms = 0 if streak >= RECENT else track.alarms
        return track.of(reduced(children))._replace(nis=nis, streak=streak, alarms=alarms)

    def _tilted(self, track: Track, spin: Spin) -> Track:
        """A robot that is tilted for long was lifted: nobody knows where it is put down."""
        if not spin.tilt > TILT:
            return track._replace(tilted_ns=LONG_AGO, lifted=False)
        if track.tilted_ns == LONG_AGO:
            return track._replace(tilted_ns=spin.stamp_ns)
        if track.lifted or spin.stamp_ns - track.tilted_ns < TILT_TIME_NS:
            return track
        track = track._replace(lifted=True, alarms=track.alarms + 1, contacts=())
        return track.widened(*self._params.widen_sigma)

    def _read(self, track: Track, hits: Hits) -> Track:
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

    def has_stuck_reed(self, track: Track) -> bool:
        """True while a reed stays closed farther than any magnet holds it."""
        limit = STUCK_PITCHES * self._params.lattice_pitch
        return any(
            each.since_last == 0.0 and abs(each.since_first) > limit for each in track.contacts
        )

    def published(self, track: Track) -> tuple[Belief, float, bool]:
        """The pose with all that it may be wrong by, how certain its cell is, and `ambiguous`.

        After an alarm it goes on as well as it can, but which cell of the lattice it is in no
        magnet tells: it is not trusted again.
        """
        wide = self._association.is_wide(track.belief)
        belief, sure = track.belief, 1.0
        if track.others:
            mixture = track.mixture
            belief, sure = spread(mixture), certainty(mixture, self._params.lattice_pitch)
        if track.alarms:
            return belief.widened(*MOVED_SIGMA), 0.0, True
        return belief, sure, wide or sure < self._params.sure


def _turning(track: Track, spin: Spin) -> Track:
    """Takes the rate of turn, unless it is one lone spike."""
    seconds = 1e-9 * (spin.stamp_ns - track.rate_ns)
    jump = abs(spin.rate - track.rate)
    if not track.spiked and seconds <= RATE_LIFE and jump > max(SPIKE, SWING * seconds):
        return track._replace(rate_ns=spin.stamp_ns, spiked=True)
    return track._replace(rate=spin.rate, rate_ns=spin.stamp_ns, spiked=False)


def _arc(way: float, turn: float) -> Delta:
    """The motion of `way` [m] along an arc that turns by `turn` [rad]."""
    chord = way * (math.sin(0.5 * turn) / (0.5 * turn) if abs(turn) > 1e-9 else 1.0)
    return Delta(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn)
