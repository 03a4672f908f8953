"""The localiser: odometry and magnets in, the robot's pose in `map` with its covariance out."""

import math
from dataclasses import dataclass

from lodeline.ekf.belief import Belief, Covariance3
from lodeline.ekf.history import History, Hits, Landmarks, Mark, Motion, Spin, Verdict
from lodeline.ekf.landmarks import Fix, Landmark
from lodeline.ekf.mixture import Hypothesis
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.sightings import Contact
from lodeline.ekf.tracker import Track, Tracker
from lodeline.ekf.turning import Agreement
from lodeline.rotation import Quaternion, Vector, rotate, yaw_of

ABSURD = 1e6  # m, rad, s or their squares: beyond it a number is refused
LATERAL_LIMIT = 1.0  # m: no bar is wider
RATE_LIMIT = 40.0  # rad/s: more than any gyro of the trade measures
SHARPEST = 1e-6  # m, rad: nothing is measured better
HITS_LIMIT = 32  # magnets in one reading


@dataclass(frozen=True, slots=True)
class LocalizerState:
    """All that a localiser needs to go on. `odom_stamp_ns` None: no odometry seen yet."""

    stamp_ns: int
    x: float
    y: float
    yaw: float
    covariance: Covariance3
    contacts: tuple[tuple[float, float, float, float], ...]
    way: float
    step: float
    nis: float
    rejected: int
    recent: int
    alarms: int
    v: float
    w: float
    weight: float
    others: tuple[tuple[float, ...], ...]
    rate: float
    rate_ns: int
    spiked: bool
    heading_ns: int
    agreement: tuple[float, float, bool]
    tilted_ns: int
    lifted: bool
    streak: int
    odom_stamp_ns: int | None
    odom_x: float
    odom_y: float
    odom_yaw: float
    odom_resets: int
    late: int
    duplicates: int
    refused: int


@dataclass(frozen=True, slots=True)
class Estimate:
    """Pose in `map` [m, rad] at `stamp_ns`, covariance of (x, y, yaw) row-major.

    `nis` is the squared Mahalanobis distance of the last detection (2 degrees of freedom, 0 before
    the first), `rejected` counts the detections that the gate refused. `ambiguous` says that
    magnets may be, or may have been, taken for their neighbours: the 3-sigma ellipse reaches half
    the pitch less the bar's own error, or the cell of the pose has less than the probability
    asked for. `certainty` is that probability, as far as it was ever in doubt; the covariance has
    all hypotheses in it. `alarms` counts how often too many magnets were not where they should
    have been, or the robot was tilted as no floor does: it was moved, or is lost, its certainty
    is 0 and stays so. `slipping` says that the wheels turn the robot otherwise than the gyro does,
    `stuck_reed` that a reed stays closed over more way than any magnet is long.
    """

    stamp_ns: int
    x: float
    y: float
    yaw: float
    covariance: Covariance3
    nis: float
    rejected: int
    ambiguous: bool
    certainty: float
    alarms: int
    slipping: bool
    stuck_reed: bool

    @property
    def trouble(self) -> str:
        """What is wrong with it and what to do, or nothing: for people to read."""
        if self.slipping:
            return "INCONSISTENT wheels and gyro: one slips or is silent, or is ill calibrated"
        if self.alarms:
            return "KIDNAPPED magnets or tilt say that the robot was moved: set its pose"
        if self.ambiguous:
            return "AMBIGUOUS the position may be wrong by a pitch of the magnets"
        if self.stuck_reed:
            return "REED_STUCK a reed stays closed: not believed until it opens"
        return ""


class Localizer:
    """EKF over odometry and reed bar, any order of arrival within its history.

    `late`, `duplicates` and `refused` count the samples that were not used and why.
    """

    def __init__(self, params: LocalizerParams) -> None:
        self._params = params
        self._tracker = tracker = Tracker(params)
        self._span_ns = round(params.history * 1e9)
        self._history: History[Track] = History(
            self._span_ns, Mark(0, None, tracker.start()), tracker.advance, tracker.observe
        )
        self.late = self.duplicates = self.refused = 0
        self._behind_since_ns: int | None = None

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
        if (
            not _sane(x, y, yaw, vv, vw, wv, ww, interval)
            or min(vv, ww, interval) < 0.0
            or abs(vw - wv) > 1e-9 * (vv + ww)
            or vw * wv > vv * ww * (1.0 + 1e-9)
        ):
            self.refused += 1
            return None
        motion = Motion(stamp_ns, x, y, yaw, (vv, vw, wv, ww), interval, resets)
        verdict = self._history.add(motion)
        if verdict == "late" and self._clock_went_back(stamp_ns):
            track = self._tracker.lost(self._history.newest.belief)
            self._history.restart(Mark(stamp_ns, motion, track))
            verdict = "used"
        if verdict != "late":
            self._behind_since_ns = None
        return self._answer(verdict)

    def magnets(self, stamp_ns: int, laterals: tuple[float, ...]) -> Estimate | None:
        """Takes one reading of the bar: lateral offsets [m], + left; empty if no reed is closed.

        Empty readings matter to the `edges` model: they tell when a reed opened and closed.
        None: nothing changed (yet: a reading newer than the newest odometry waits for it).
        """
        if len(laterals) > HITS_LIMIT or not all(abs(each) <= LATERAL_LIMIT for each in laterals):
            self.refused += 1
            return None
        return self._answer(self._history.add(Hits(stamp_ns, tuple(laterals))))

    def landmarks(self, stamp_ns: int, seen: tuple[Landmark, ...]) -> Estimate | None:
        """Takes what was measured to known points at one moment.

        None: nothing changed yet, or a number was not finite, a sigma not positive, a sighting
        without range and bearing: then none of them is used.
        """
        if len(seen) > HITS_LIMIT or not all(map(_measured, seen)):
            self.refused += 1
            return None
        return self._answer(self._history.add(Landmarks(stamp_ns, tuple(seen))))

    def attitude(
        self,
        stamp_ns: int,
        orientation: Quaternion,
        angular_velocity: Vector,
        heading_std: float,
        *,
        disturbed: bool,
    ) -> Estimate | None:
        """Takes what the IMU says: body to world, body rates less their bias [rad/s].

        The rate of turn goes into each step beside the wheels', the heading only as far as
        `heading` of the parameters lets it, and not while the field is `disturbed`. None: nothing
        changed yet.
        """
        norm = math.fsum(part * part for part in orientation)
        if (
            not _sane(*orientation, *angular_velocity, heading_std)
            or abs(norm - 1.0) > 1e-3
            or max(map(abs, angular_velocity)) > RATE_LIMIT
            or heading_std < 0.0
        ):
            self.refused += 1
            return None
        up = rotate(orientation, (0.0, 0.0, 1.0))[2]
        spin = Spin(
            stamp_ns,
            rotate(orientation, angular_velocity)[2],
            yaw_of(orientation),
            math.inf if disturbed else heading_std,
            math.acos(max(-1.0, min(1.0, up))),
        )
        return self._answer(self._history.add(spin))

    @property
    def estimate(self) -> Estimate | None:
        """The latest estimate; None before the first odometry."""
        mark = self._history.newest
        if mark.motion is None:
            return None
        belief, sure, ambiguous = self._tracker.published(mark.belief)
        return Estimate(
            mark.stamp_ns,
            belief.x,
            belief.y,
            belief.yaw,
            belief.covariance,
            mark.belief.nis,
            mark.belief.rejected,
            ambiguous,
            sure,
            mark.belief.alarms,
            mark.belief.agreement.doubted,
            self._tracker.has_stuck_reed(mark.belief),
        )

    @property
    def state(self) -> LocalizerState:
        """What `resume` needs; samples that wait for odometry are not in it."""
        mark = self._history.newest
        track, belief, motion = mark.belief, mark.belief.belief, mark.motion
        return LocalizerState(
            mark.stamp_ns,
            belief.x,
            belief.y,
            belief.yaw,
            belief.covariance,
            tuple((each[0], each[1], each[2], each[3]) for each in track.contacts),
            track.way,
            track.step,
            track.nis,
            track.rejected,
            track.recent,
            track.alarms,
            track.v,
            track.w,
            track.weight,
            tuple((weight, *other) for weight, other in track.others),
            track.rate,
            track.rate_ns,
            track.spiked,
            track.heading_ns,
            (track.agreement[0], track.agreement[1], track.agreement[2]),
            track.tilted_ns,
            track.lifted,
            track.streak,
            motion.stamp_ns if motion else None,
            motion.x if motion else 0.0,
            motion.y if motion else 0.0,
            motion.yaw if motion else 0.0,
            motion.resets if motion else 0,
            self.late,
            self.duplicates,
            self.refused,
        )

    def resume(self, state: LocalizerState, widen: tuple[float, float] = (0.0, 0.0)) -> None:
        """Goes on from a saved state, less sure by `widen` (standard deviations [m, rad])."""
        p = state.covariance
        belief = Belief(state.x, state.y, state.yaw, p[0], p[1], p[2], p[4], p[5], p[8])
        others = [Hypothesis(weight, Belief(*other)) for weight, *other in state.others]
        beliefs = (belief, *(other.belief for other in others))
        weights = (state.weight, *(other.weight for other in others))
        if not (all(each.finite for each in beliefs) and all(0.0 < w <= 1.0 for w in weights)):
            raise ValueError("the saved state has a number in it that is not finite")
        motion = None
        if state.odom_stamp_ns is not None:
            pose = (state.odom_x, state.odom_y, state.odom_yaw)
            motion = Motion(
                state.odom_stamp_ns, *pose, (0.0, 0.0, 0.0, 0.0), 0.0, state.odom_resets
            )
        track = Track(
            belief.widened(*widen).positive(),
            tuple(Contact(*each) for each in state.contacts),
            state.way,
            state.step,
            state.nis,
            state.rejected,
            state.recent,
            state.alarms,
            state.v,
            state.w,
            weight=state.weight,
            others=tuple(Hypothesis(w, other.widened(*widen).positive()) for w, other in others),
            rate=state.rate,
            rate_ns=state.rate_ns,
            spiked=state.spiked,
            heading_ns=state.heading_ns,
            agreement=Agreement(*state.agreement),
            tilted_ns=state.tilted_ns,
            lifted=state.lifted,
            streak=state.streak,
        )
        self._history.restart(Mark(state.stamp_ns, motion, track))
        self.late, self.duplicates = state.late, state.duplicates
        self.refused = state.refused

    def _clock_went_back(self, stamp_ns: int) -> bool:
        """True when odometry has come too late, and nothing else, for as long as the history.

        One stamp far ahead, or a source that starts its clock again, must not shut it out for ever.
        """
        since = self._behind_since_ns
        if since is None or stamp_ns < since:
            self._behind_since_ns = stamp_ns
            return False
        return stamp_ns - since > self._span_ns

    def _answer(self, verdict: Verdict) -> Estimate | None:
        if verdict == "used":
            return self.estimate
        if verdict == "late":
            self.late += 1
        elif verdict == "duplicate":
            self.duplicates += 1
        elif verdict == "full":
            self.refused += 1
        return None


def _sane(*values: float) -> bool:
    return all(abs(value) <= ABSURD for value in values)  # False for NaN


def _measured(landmark: Landmark) -> bool:
    """True for a landmark that makes sense."""
    if isinstance(landmark, Fix):
        return _sane(*landmark) and landmark.sigma > SHARPEST
    values = [each for each in landmark if each is not None]
    return (
        _sane(*values)
        and min(landmark.range_sigma, landmark.bearing_sigma) > SHARPEST
        and (landmark.range is not None or landmark.bearing is not None)
    )
