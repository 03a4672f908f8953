"""What a reading of the IMU does to the track: rate of turn, lift, and now and then a heading."""

import math

from lodeline.ekf.belief import made
from lodeline.ekf.engine import Engine
from lodeline.ekf.mixture import Hypothesis
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Spin
from lodeline.ekf.track import Track
from lodeline.rotation import wrap_angle

HEADING_GATE = 6.63  # 99 % of chi-square, 1 degree of freedom


class Inertial:
    """Pure steps from track to track, one for each reading of the IMU."""

    def __init__(self, engine: Engine, params: LocalizerParams) -> None:
        self._engine, self._params, self._has_compass = engine, params, params.heading == "on"

    def read(self, track: Track, spin: Spin) -> Track:
        """From here on the robot turns as the gyro says; was it lifted? which way is north?"""
        mixture, pace, turning, bar, before, trust, compass_ns, wide, learned = track
        stamp_ns, rate, _, _, tilt = spin
        lift, turning = before.after(tilt, stamp_ns), turning.after(rate, stamp_ns)
        parts = mixture, pace, turning, bar, lift, trust, compass_ns, wide, learned
        track = made(Track, parts)
        if lift is not before and lift.lifted and not before.lifted:
            track = track.alarmed(*self._params.widen_sigma)
        if self._has_compass and self._is_due(compass_ns, spin):
            return self._headed(track, spin)
        return track

    def _is_due(self, last_ns: int | None, spin: Spin) -> bool:
        """Whether it is time for another heading, and there is one."""
        if not math.isfinite(spin.heading_sigma):
            return False
        return last_ns is None or spin.stamp_ns - last_ns >= self._params.heading_interval * 1e9

    def _headed(self, track: Track, spin: Spin) -> Track:
        """After a heading, unless it is far from what any hypothesis says."""
        variance = spin.heading_sigma**2 + self._params.heading_sigma**2
        headed = []
        for weight, belief in track.mixture:
            off = wrap_angle(spin.heading - belief.yaw)
            if off * off > HEADING_GATE * (belief.p22 + variance):
                return track
            after = self._engine.correct_scalar(belief, (0.0, 0.0, 1.0), off, variance)
            headed.append(Hypothesis(weight, after.positive()))
        return track._replace(mixture=tuple(headed), compass_ns=spin.stamp_ns)
