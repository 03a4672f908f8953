"""What a motion does to the track: the prediction of the EKF, by wheels and gyro together."""

from math import hypot
from typing import NamedTuple

from lodeline.ekf.agreement import Agreement, doubting
from lodeline.ekf.belief import made
from lodeline.ekf.engine import Engine, Noise
from lodeline.ekf.gyro import Turn
from lodeline.ekf.mixture import Hypothesis, Mixture
from lodeline.ekf.motion import Delta, Pace, arc, part, relative, twist
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.reeds import BarMemory
from lodeline.ekf.samples import Motion
from lodeline.ekf.track import Track
from lodeline.ekf.turning import fused

COAST = 1.0  # s: for so long a robot that nobody measures is taken to go on as it went


class Way(NamedTuple):
    """From one odometry pose to the next, for all its parts: they take a share of it each.

    `jumped`: nobody measured it.
    """

    gap_ns: int
    seconds: float
    delta: Delta
    twist: Delta
    pace: Pace
    jumped: bool
    noise: Noise


class Mover:
    """Pure steps from track to track along the odometry."""

    def __init__(self, engine: Engine, params: LocalizerParams) -> None:
        self._predict, self._params, self._bar_x = engine.predict, params, params.bar_x
        self._last: tuple[Motion, Motion, Way] | None = None

    def advance(
        self,
        track: Track,
        before: Motion,
        after: Motion,
        from_ns: int,
        to_ns: int,
        gyro: Turn | None,
    ) -> Track:
        """After a part of the motion between two samples, by stamps [ns]; its turn by the gyro."""
        last = self._last
        if last is not None and last[0] is before and last[1] is after:
            way = last[2]
        else:
            way = self._way(before, after)
            self._last = before, after, way
        gap_ns, seconds, delta, twist, pace, jumped, noise = way
        mixture, _, agreement, bar, lift, trust, compass_ns, wide, learned = track
        share = (to_ns - from_ns) / gap_ns
        seconds *= share
        if jumped:
            track = self.lost(track, seconds, share, gyro)
            return track._replace(pace=track.pace._replace(unmeasured=to_ns < after.stamp_ns))
        ss, st, tt, position, heading = noise
        if gyro is None:
            position += self._bend(pace, way.seconds, after.interval)
        if share < 1.0:  # white in time: a share of it for a share of it
            ss, st, tt = share * ss, share * st, share * tt
            position, heading = share * position, share * heading
            delta = part(twist, share)
        noise = made(Noise, (ss, st, tt, position, heading))
        if gyro is not None:
            agreement, delta, noise = self._with_gyro(agreement, delta, noise, gyro, seconds)
        ahead, left, turn = delta
        bar = bar.moved(hypot(ahead, left + self._bar_x * turn), ahead)
        mixture = self._predicted(mixture, delta, noise)
        return made(Track, (mixture, pace, agreement, bar, lift, trust, compass_ns, wide, learned))

    def lost(
        self,
        track: Track,
        seconds: float = 0.0,
        share: float = 1.0,
        gyro: Turn | None = None,
    ) -> Track:
        """After `seconds` in which nobody measured where the robot went, or a `share` of a gap.

        It is taken to have gone on as it went; that it stopped at once is one sigma off. `gyro`
        is the turn that the gyro saw [rad].
        """
        position, heading = self._params.reset_sigma
        reach = min(seconds, COAST * share)
        # of a gap in several parts each brings its share of the variance of the whole
        along, turn = track.pace.v * seconds, track.pace.w * seconds
        tt, doubt = turn * turn / share, share * heading * heading
        if gyro is None:
            delta = arc(track.pace.v * reach, track.pace.w * reach)
        else:
            delta = arc(track.pace.v * reach, gyro.angle)
            tt, doubt = gyro.variance, 0.0
        noise = Noise(along * along / share, 0.0, tt, share * position * position, doubt)
        mixture = self._predicted(track.mixture, delta, noise)
        return track._replace(mixture=mixture, bar=BarMemory())

    def _predicted(self, mixture: Mixture, delta: Delta, noise: Noise) -> Mixture:
        """Every hypothesis after the same step."""
        predict = self._predict
        if len(mixture) == 1:
            ((weight, belief),) = mixture
            return (made(Hypothesis, (weight, predict(belief, delta, noise))),)
        return tuple([Hypothesis(w, predict(belief, delta, noise)) for w, belief in mixture])

    def _way(self, before: Motion, after: Motion) -> Way:
        gap_ns = after.stamp_ns - before.stamp_ns
        seconds = gap_ns * 1e-9
        delta = relative(before.x, before.y, before.yaw, after.x, after.y, after.yaw)
        ahead, left, turn = delta
        jumped = after.resets != before.resets or (
            hypot(ahead, left) > self._params.max_speed * seconds
        )
        pace = made(Pace, (ahead / seconds, turn / seconds, False))
        noise = self._noise(before, after, seconds)
        return made(Way, (gap_ns, seconds, delta, twist(delta), pace, jumped, noise))

    def _with_gyro(
        self, before: Agreement, delta: Delta, noise: Noise, turn: Turn, seconds: float
    ) -> tuple[Agreement, Delta, Noise]:
        """The step as wheels and gyro see it together; where they differ too much, the gyro."""
        (angle, variance), (_, _, tt, _, _), (_, _, wheels) = turn, noise, delta
        off = angle - wheels
        agreement = before.after(off, tt + variance, seconds)
        if before.doubted or agreement.doubted:
            noise = doubting(noise, off, agreement, seconds, self._params.track)
        delta, noise = fused(delta, noise, turn)
        return agreement, delta, noise

    def _noise(self, before: Motion, after: Motion, seconds: float) -> Noise:
        """Q of the lab in one of its two forms, for the way between two samples."""
        if self._params.process_noise == "alpha":
            steps = seconds / after.interval if after.interval > 0.0 else 1.0
            position, heading = self._params.alpha_sigma
            return Noise(0.0, 0.0, 0.0, steps * position**2, steps * heading**2)
        worst = after
        if after.interval < 0.99 * seconds:
            # samples in between were lost: it may have come to rest only in the last of them
            worst = max(after, before, key=lambda each: each.interval * each.twist_covariance[3])
        # white in time: what the twist's covariance is worth over `interval`, for `seconds`
        vv, vw, _, ww = worst.twist_covariance
        scale = worst.interval * seconds
        return made(Noise, (scale * vv, scale * vw, scale * ww, 0.0, 0.0))

    def _bend(self, pace: Pace, seconds: float, interval: float) -> float:
        """Variance [m^2] of a way whose two ends are known, for how it went in between is not.

        With rates that are random walks of density q, their deviation from the mean moves the end
        of a way of T by v sqrt(q_w T^5 / 120), and likewise with v and w changed over. The ends
        are those of each `interval` that the odometry looked at.
        """
        q_v, q_w = (each * each for each in self._params.wander)
        step = min(interval, seconds) if interval > 0.0 else seconds
        return (pace.v**2 * q_w + pace.w**2 * q_v) * seconds * step**4 / 120.0
