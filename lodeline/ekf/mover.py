"""What a motion does to the track: the prediction of the EKF, by wheels and gyro together."""

import math
from dataclasses import replace

from lodeline.ekf.agreement import doubting
from lodeline.ekf.engine import Engine, Noise
from lodeline.ekf.motion import Delta, Pace, arc, part, relative
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.reeds import BarMemory
from lodeline.ekf.samples import Motion
from lodeline.ekf.track import Track
from lodeline.ekf.turning import Turn, Turning, fused

COAST = 1.0  # s: for so long a robot that nobody measures is taken to go on as it went


class Mover:
    """Pure steps from track to track along the odometry."""

    def __init__(self, engine: Engine, params: LocalizerParams) -> None:
        self._engine, self._params = engine, params

    def advance(
        self, track: Track, before: Motion, after: Motion, begin: float, end: float
    ) -> Track:
        """After the part from `begin` to `end` (fractions) of the motion between two samples."""
        params, share = self._params, end - begin
        gap_ns = after.stamp_ns - before.stamp_ns
        seconds = gap_ns * 1e-9
        delta = relative(before.x, before.y, before.yaw, after.x, after.y, after.yaw)
        turning = track.turning
        gyro = turning.over(
            before.stamp_ns + begin * gap_ns,
            seconds * share,
            params.gyro_noise,
            params.wander[1],
        )
        if after.resets != before.resets or (
            math.hypot(delta.ahead, delta.left) > params.max_speed * seconds
        ):
            track = self.lost(track, seconds * share, share, gyro)
            return replace(track, pace=replace(track.pace, unmeasured=end < 1.0))
        pace = Pace(delta.ahead / seconds, delta.turn / seconds)
        if share < 1.0:
            delta = part(delta, begin, end)
        noise = self._noise(before, after, share)
        if gyro is None:
            noise = noise._replace(position=noise.position + share * self._bend(pace, seconds))
        else:
            turning, delta, noise = self._with_gyro(turning, delta, noise, gyro, seconds * share)
        way = math.hypot(delta.ahead, delta.left + params.bar_x * delta.turn)
        bar, predict = track.bar.moved(way, delta.ahead), self._engine.predict
        return track.moved(lambda belief: predict(belief, delta, noise), pace, turning, bar)

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
        predict = self._engine.predict
        return track.moved(
            lambda belief: predict(belief, delta, noise), track.pace, track.turning, BarMemory()
        )

    def _with_gyro(
        self, turning: Turning, delta: Delta, noise: Noise, turn: Turn, seconds: float
    ) -> tuple[Turning, Delta, Noise]:
        """The step as wheels and gyro see it together; where they differ too much, the gyro."""
        off = turn.angle - delta.turn
        agreement = turning.agreement.after(off, noise.tt + turn.variance, seconds)
        if turning.agreement.doubted or agreement.doubted:
            noise = doubting(noise, off, agreement, seconds, self._params.track)
        delta, noise = fused(delta, noise, turn)
        return replace(turning, agreement=agreement), delta, noise

    def _noise(self, before: Motion, after: Motion, share: float) -> Noise:
        """Q of the lab in one of its two forms, for a `share` of the way between two samples."""
        seconds = share * 1e-9 * (after.stamp_ns - before.stamp_ns)
        if self._params.process_noise == "alpha":
            steps = seconds / after.interval if after.interval > 0.0 else 1.0
            position, heading = self._params.alpha_sigma
            return Noise(0.0, 0.0, 0.0, steps * position**2, steps * heading**2)
        if share * after.interval < 0.99 * seconds:
            # samples in between were lost: it may have come to rest only in the last of them
            after = max(after, before, key=lambda each: each.interval * each.twist_covariance[3])
        # white in time: what the twist's covariance is worth over `interval`, for `seconds`
        vv, vw, _, ww = after.twist_covariance
        scale = after.interval * seconds
        return Noise(scale * vv, scale * vw, scale * ww)

    def _bend(self, pace: Pace, seconds: float) -> float:
        """Variance [m^2] of a way whose two ends are known, for how it went in between is not.

        With rates that are random walks of density q, their deviation from the mean moves the end
        of a way of T by v sqrt(q_w T^5 / 120), and likewise with v and w changed over.
        """
        q_v, q_w = (each * each for each in self._params.wander)
        return (pace.v**2 * q_w + pace.w**2 * q_v) * seconds**5 / 120.0
