"""What a heading does to the track: now and then one is used, for its error stays the same."""

from lodeline.ekf.engine import Engine
from lodeline.ekf.mixture import Hypothesis
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Heading
from lodeline.ekf.track import Track
from lodeline.rotation import wrap_angle

HEADING_GATE = 6.63  # 99 % of chi-square, 1 degree of freedom


class Compass:
    """Pure steps from track to track, one for each heading."""

    def __init__(self, engine: Engine, params: LocalizerParams) -> None:
        self._engine, self._sigma = engine, params.heading_sigma
        self._interval_ns = params.heading_interval * 1e9

    def read(self, track: Track, heading: Heading) -> Track:
        """After a heading, if it is time for one, unless it is far from what a hypothesis says."""
        last_ns = track.compass_ns
        if last_ns is not None and heading.stamp_ns - last_ns < self._interval_ns:
            return track
        variance = heading.sigma**2 + self._sigma**2
        headed = []
        for weight, belief in track.mixture:
            off = wrap_angle(heading.yaw - belief.yaw)
            if off * off > HEADING_GATE * (belief.p22 + variance):
                return track
            after = self._engine.correct_scalar(belief, (0.0, 0.0, 1.0), off, variance)
            headed.append(Hypothesis(weight, after.positive()))
        return track._replace(mixture=tuple(headed), compass_ns=heading.stamp_ns)
