"""The localiser: odometry and magnets in, the robot's pose in `map` with its covariance out."""

import math

from lodeline.ekf.belief import made
from lodeline.ekf.estimate import Estimate
from lodeline.ekf.history import History, Mark, Verdict
from lodeline.ekf.learning import LearningTracker
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Fix, Heading, Hits, Landmarks, Motion, Sighting, Spin
from lodeline.ekf.setback import Setback
from lodeline.ekf.state import LocalizerState, Unused
from lodeline.ekf.track import Track
from lodeline.ekf.tracker import Tracker
from lodeline.rotation import Quaternion, Vector, height, tilt_of, yaw_of

ABSURD = 1e6  # m, rad, s or their squares: beyond it a number is refused
LATERAL_LIMIT = 1.0  # m: no bar is wider
RATE_LIMIT = 40.0  # rad/s: more than any gyro of the trade measures
SHARPEST = 1e-6  # m, rad: nothing is measured better
HITS_LIMIT = 32  # magnets in one reading


class Localizer:
    """EKF over odometry and reed bar, any order of arrival within its history.

    `late`, `duplicates` and `refused` count the samples that were not used and why.
    """

    def __init__(self, params: LocalizerParams) -> None:
        self._params, self._has_compass = params, params.heading == "on"
        self._tracker = tracker = LearningTracker(params) if params.learns else Tracker(params)
        self._gyro, self._span_ns = tracker.gyro, round(params.history * 1e9)
        self._history: History[Track] = History(
            self._span_ns, Mark(0, None, tracker.start()), tracker.advance, tracker.observe
        )
        self.late = self.duplicates = self.refused = 0
        # One stamp far ahead, or a source that starts its clock again, shuts nobody out for ever.
        self._odometry_clock, self._gyro_clock = Setback(self._span_ns), Setback(self._span_ns)

    def odometry(
        self,
        stamp_ns: int,
        x: float,
        y: float,
        yaw: float,
        twist_covariance: tuple[float, float, float, float],
        interval: float,
        resets: int,
    ) -> Estimate | None:
        """Takes a pose in `odom`; only its difference to the pose before it counts.

        `twist_covariance` is that of the mean (v, w) over `interval` [s], row-major. None: the
        sample changed nothing (refused, late or a duplicate, which is counted).
        """
        vv, vw, wv, ww = twist_covariance
        if not (  # so put that no NaN passes
            -ABSURD <= x <= ABSURD
            and -ABSURD <= y <= ABSURD
            and -ABSURD <= yaw <= ABSURD
            and 0.0 <= vv <= ABSURD
            and 0.0 <= ww <= ABSURD
            and 0.0 <= interval <= ABSURD
            and abs(vw - wv) <= 1e-9 * (vv + ww)
            and vw * wv <= vv * ww * (1.0 + 1e-9)
        ):
            self.refused += 1
            return None
        motion = made(Motion, (stamp_ns, x, y, yaw, twist_covariance, interval, resets))
        verdict = self._history.add(motion)
        if verdict == "late" and self._odometry_clock.old(stamp_ns):
            track = self._tracker.lost(self._history.newest.belief)
            self._restart(Mark(stamp_ns, motion, track))
            verdict = "used"
        if verdict != "late":
            self._odometry_clock.fresh()
            self._gyro.forget(self._history.oldest_ns)
        return self._answer(verdict)

    def magnets(self, stamp_ns: int, laterals: tuple[float, ...]) -> Estimate | None:
        """Takes one reading of the bar: lateral offsets [m], + left; empty if no reed is closed.

        Empty readings matter to the `edges` model: they tell when a reed opened and closed.
        None: it is empty, which tells no pose, or nothing changed (yet: a reading newer than the
        newest odometry waits for it).
        """
        if laterals and not (
            len(laterals) <= HITS_LIMIT and all(abs(each) <= LATERAL_LIMIT for each in laterals)
        ):
            self.refused += 1
            return None
        verdict = self._history.add(Hits(stamp_ns, tuple(laterals)))
        if laterals:
            return self._answer(verdict)
        self._count(verdict)
        return None

    def landmarks(self, stamp_ns: int, seen: tuple[Sighting, ...]) -> Estimate | None:
        """Takes what was measured to known points at one moment.

        None: nothing changed yet, or a number was not finite, a sigma not positive, a sighting
        without range and bearing: then none of them is used.
        """
        if len(seen) > HITS_LIMIT or not all(map(_measured, seen)):
            self.refused += 1
            return None
        return self._answer(self._history.add(Landmarks(stamp_ns, tuple(seen))))

    def position(self, stamp_ns: int, x: float, y: float, sigma: float) -> Estimate | None:
        """Takes a measured position of `base_link` in `map` and its deviation per axis [m].

        None: nothing changed yet, or a number was not finite, or `sigma` not positive.
        """
        if not (_sane(x, y, sigma) and sigma > SHARPEST):
            self.refused += 1
            return None
        return self._answer(self._history.add(Fix(stamp_ns, x, y, sigma)))

    def attitude(
        self,
        stamp_ns: int,
        orientation: Quaternion,
        angular_velocity: Vector,
        heading_std: float,
        *,
        disturbed: bool,
    ) -> None:
        """Takes what the IMU says: body to world, body rates less their bias [rad/s].

        The rate of turn goes into each step beside the wheels', the heading only as far as
        `heading` of the parameters lets it, and not while the field is `disturbed`. The next
        estimate tells what it changed.
        """
        x, y, z, w = orientation
        wx, wy, wz = angular_velocity
        if not (  # so put that no NaN passes
            abs(x * x + y * y + z * z + w * w - 1.0) <= 1e-3
            and abs(wx) <= RATE_LIMIT
            and abs(wy) <= RATE_LIMIT
            and abs(wz) <= RATE_LIMIT
            and 0.0 <= heading_std <= ABSURD
        ):
            self.refused += 1
            return
        if self._is_late(stamp_ns):
            self.late += 1
            return
        rate = height(orientation, angular_velocity)
        spin = made(Spin, (stamp_ns, rate, tilt_of(orientation)))
        if not self._gyro.add(spin):
            self.duplicates += 1
            return
        self._history.touch(stamp_ns)
        if self._has_compass and not disturbed and math.isfinite(heading_std):
            self._count(self._history.add(Heading(stamp_ns, yaw_of(orientation), heading_std)))

    @property
    def estimate(self) -> Estimate | None:
        """The latest estimate; None before the first odometry."""
        mark = self._history.newest
        if mark.motion is None:
            return None
        track = mark.belief
        belief, sure, ambiguous = self._tracker.published(track)
        trust, doubted = track.trust, track.agreement.doubted
        where = mark.stamp_ns, belief.x, belief.y, belief.yaw, belief.covariance
        believed = trust.nis, trust.rejected, ambiguous, sure, trust.alarms
        return made(Estimate, (*where, *believed, doubted, self._tracker.has_stuck_reed(track)))

    @property
    def state(self) -> LocalizerState:
        """What `resume` needs; samples that wait for odometry are not in it."""
        mark = self._history.newest
        unused = Unused(self.late, self.duplicates, self.refused)
        return LocalizerState(mark.stamp_ns, mark.motion, mark.belief, unused)

    def resume(self, state: LocalizerState, widen: tuple[float, float] = (0.0, 0.0)) -> None:
        """Goes on from a saved state, less sure by `widen` (standard deviations [m, rad]).

        ValueError, with nothing changed, for a state that no localiser saved.
        """
        track = state.checked().track.widened(*widen)
        if self._params.learns != (track.learned is not None):
            track = track._replace(learned=self._tracker.start().learned)
        self._restart(Mark(state.stamp_ns, state.odometry, self._tracker.marked(track)))
        unused = state.unused
        self.late, self.duplicates, self.refused = unused.late, unused.duplicates, unused.refused

    def _restart(self, start: Mark[Track]) -> None:
        self._history.restart(start)
        self._gyro.restart(start.belief.lift)

    def _is_late(self, stamp_ns: int) -> bool:
        """True for a reading of the gyro that is too old, unless its clock was set back."""
        if not self._history.reaches(stamp_ns):
            return True
        newest_ns = self._gyro.newest_ns
        if newest_ns is None or stamp_ns >= newest_ns - self._span_ns:
            self._gyro_clock.fresh()
            return False
        if self._gyro_clock.old(stamp_ns):
            self._gyro.restart()
            return False
        return True

    def _answer(self, verdict: Verdict) -> Estimate | None:
        if verdict == "used":
            return self.estimate
        self._count(verdict)
        return None

    def _count(self, verdict: Verdict) -> None:
        if verdict == "late":
            self.late += 1
        elif verdict == "duplicate":
            self.duplicates += 1
        elif verdict == "full":
            self.refused += 1


def _sane(*values: float) -> bool:
    return all(abs(value) <= ABSURD for value in values)  # False for NaN


def _measured(landmark: Sighting) -> bool:
    """True for a landmark that makes sense."""
    values = [each for each in landmark if each is not None]
    return (
        _sane(*values)
        and min(landmark.range_sigma, landmark.bearing_sigma) > SHARPEST
        and (landmark.range is not None or landmark.bearing is not None)
    )
