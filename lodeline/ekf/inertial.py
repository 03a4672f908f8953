"""What a reading of the IMU does to the track: rate of turn, lift, and now and then a heading."""

import math

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
        self._engine, self._params = engine, params

    def read(self, track: Track, spin: Spin) -> Track:
        """From here on the robot turns as the gyro says; was it lifted? which way is north?"""
        mixture, pace, turning, bar, before, trust, compass_ns, wide, learned = track
        was_lifted, lift = before.lifted, before.after(spin.tilt, spin.stamp_ns)
        turning = turning.after(spin.rate, spin.stamp_ns)
        track = Track(mixture, pace, turning, bar, lift, trust, compass_ns, wide, learned)
        if lift.lifted and not was_lifted:
            track = track.alarmed(*self._params.widen_sigma)
        return self._headed(track, spin) if self._uses_heading(track, spin) else track

    def _uses_heading(self, track: Track, spin: Spin) -> bool:
        params, last_ns = self._params, track.compass_ns
        if params.heading == "off" or not math.isfinite(spin.heading_sigma):
            return False
        return last_ns is None or spin.stamp_ns - last_ns >= params.heading_interval * 1e9

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
