"""The localiser: odometry and magnets in, the robot's pose in `map` with its covariance out."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from lodeline.ekf.belief import Belief, Covariance3, certain
from lodeline.ekf.engine import Detection, EngineName, Noise, make_engine
from lodeline.ekf.history import History, Hits, Mark, Motion, Verdict
from lodeline.ekf.motion import part, relative
from lodeline.magnets.lattice import Lattice

ABSURD = 1e6  # m, rad, s or their squares: beyond it a number is refused
LATERAL_LIMIT = 1.0  # m: no bar is wider
HITS_LIMIT = 32  # magnets in one reading


@dataclass(frozen=True, slots=True)
class LocalizerParams:
    """Where it starts, what it sees, and how much it trusts what it sees."""

    engine: EngineName = "scalar"
    initial_pose: Annotated[tuple[float, float, float], "m, m, rad"] = (0.0, 0.0, 0.0)
    initial_sigma: Annotated[tuple[float, float], "m, rad"] = (0.005, 0.05)
    lattice_pitch: Annotated[float, "m"] = 0.055
    lattice_origin: Annotated[tuple[float, float], "m"] = (0.0, 0.0)
    bar_x: Annotated[float, "m"] = 0.080
    process_noise: Literal["input", "alpha"] = "input"
    alpha_sigma: Annotated[tuple[float, float], "m, rad per odometry step"] = (0.001, 0.01)
    magnet_model: Literal["plain", "passage"] = "passage"
    magnet_sigma: Annotated[tuple[float, float], "m ahead, m left"] = (0.005, 0.003)
    passage: Annotated[float, "m"] = 0.0165
    gate: Annotated[float, "1"] = 9.21
    widen_after: Annotated[int, "rejections in a row"] = 5
    widen_sigma: Annotated[tuple[float, float], "m, rad"] = (0.010, 0.05)
    reset_sigma: Annotated[tuple[float, float], "m, rad"] = (0.05, 0.2)
    max_speed: Annotated[float, "m/s"] = 5.0
    history: Annotated[float, "s"] = 1.0


class Track(NamedTuple):
    """What is carried from sample to sample: the belief and the marks of its detections."""

    belief: Belief
    way: float = 0.0  # of the bar since the last reading of it [m]
    nis: float = 0.0
    rejected: int = 0
    rejected_in_row: int = 0


@dataclass(frozen=True, slots=True)
class LocalizerState:
    """All that a localiser needs to go on. `odom_stamp_ns` None: no odometry seen yet."""

    stamp_ns: int
    x: float
    y: float
    yaw: float
    covariance: Covariance3
    way: float
    nis: float
    rejected: int
    rejected_in_row: int
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
    the first), `rejected` counts the detections that the gate refused, `ambiguous` says that the
    3-sigma ellipse reaches beyond half the pitch: the magnets may be taken for their neighbours.
    """

    stamp_ns: int
    x: float
    y: float
    yaw: float
    covariance: Covariance3
    nis: float
    rejected: int
    ambiguous: bool


class Localizer:
    """EKF over odometry and reed bar, any order of arrival within its history.

    `late`, `duplicates` and `refused` count the samples that were not used and why.
    """

    def __init__(self, params: LocalizerParams) -> None:
        self._params = params
        self._engine = make_engine(params.engine)
        self._lattice = Lattice(params.lattice_pitch, *params.lattice_origin)
        start = certain(*params.initial_pose).widened(*params.initial_sigma)
        self._history: History[Track] = History(
            round(params.history * 1e9), Mark(0, None, Track(start)), self._advance, self._observe
        )
        self.late = self.duplicates = self.refused = 0
        self._late_in_row = 0

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
        return self._take(motion)

    def magnets(self, stamp_ns: int, laterals: tuple[float, ...]) -> Estimate | None:
        """Takes one reading of the bar: lateral offsets [m], + left; empty if no reed is closed.

        Empty readings matter to the `passage` model: they tell how far the bar went between two.
        None: nothing changed (yet: a reading newer than the newest odometry waits for it).
        """
        if len(laterals) > HITS_LIMIT or not all(abs(each) <= LATERAL_LIMIT for each in laterals):
            self.refused += 1
            return None
        return self._take(Hits(stamp_ns, tuple(laterals)))

    @property
    def estimate(self) -> Estimate | None:
        """The latest estimate; None before the first odometry."""
        mark = self._history.newest
        if mark.motion is None:
            return None
        belief, _, nis, rejected, _ = mark.belief
        return Estimate(
            mark.stamp_ns,
            belief.x,
            belief.y,
            belief.yaw,
            belief.covariance,
            nis,
            rejected,
            3.0 * belief.position_sigma > 0.5 * self._params.lattice_pitch,
        )

    @property
    def state(self) -> LocalizerState:
        """What `resume` needs; samples that wait for odometry are not in it."""
        mark = self._history.newest
        (belief, way, nis, rejected, in_row), motion = mark.belief, mark.motion
        return LocalizerState(
            mark.stamp_ns,
            belief.x,
            belief.y,
            belief.yaw,
            belief.covariance,
            way,
            nis,
            rejected,
            in_row,
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
        if not belief.finite:
            raise ValueError("the saved state has a number in it that is not finite")
        motion = None
        if state.odom_stamp_ns is not None:
            pose = (state.odom_x, state.odom_y, state.odom_yaw)
            motion = Motion(
                state.odom_stamp_ns, *pose, (0.0, 0.0, 0.0, 0.0), 0.0, state.odom_resets
            )
        track = Track(
            belief.widened(*widen), state.way, state.nis, state.rejected, state.rejected_in_row
        )
        self._history.restart(Mark(state.stamp_ns, motion, track))
        self.late, self.duplicates = state.late, state.duplicates
        self.refused = state.refused

    def _take(self, sample: Motion | Hits) -> Estimate | None:
        verdict: Verdict = self._history.add(sample)
        if verdict == "used":
            return self.estimate
        if verdict == "late":
            self.late += 1
        elif verdict == "duplicate":
            self.duplicates += 1
        elif verdict == "full":
            self.refused += 1
        return None

    def _advance(
        self, track: Track, before: Motion, after: Motion, begin: float, end: float
    ) -> Track:
        params, share = self._params, end - begin
        seconds = (after.stamp_ns - before.stamp_ns) * 1e-9
        delta = relative(before.x, before.y, before.yaw, after.x, after.y, after.yaw)
        if after.resets != before.resets or (
            math.hypot(delta.ahead, delta.left) > params.max_speed * seconds
        ):
            # where the robot went meanwhile nobody measured
            doubt = math.sqrt(share)
            position, heading = params.reset_sigma
            return track._replace(belief=track.belief.widened(doubt * position, doubt * heading))
        if share < 1.0:
            delta = part(delta, begin, end)
        belief = self._engine.predict(track.belief, delta, self._noise(after, seconds * share))
        way = math.hypot(delta.ahead, delta.left + params.bar_x * delta.turn)
        return track._replace(belief=belief, way=track.way + way)

    def _noise(self, motion: Motion, seconds: float) -> Noise:
        if self._params.process_noise == "alpha":
            steps = seconds / motion.interval if motion.interval > 0.0 else 1.0
            position, heading = self._params.alpha_sigma
            return Noise(0.0, 0.0, 0.0, steps * position**2, steps * heading**2)
        # white in time: what the twist's covariance is worth over `interval`, for `seconds`
        vv, vw, _, ww = motion.twist_covariance
        scale = motion.interval * seconds
        return Noise(scale * vv, scale * vw, scale * ww)

    def _observe(self, track: Track, hits: Hits) -> Track:
        for lateral in hits.laterals:
            track = self._detect(track, lateral)
        return track._replace(way=0.0)

    def _detect(self, track: Track, lateral: float) -> Track:
        params, belief = self._params, track.belief
        ahead_sigma, left_sigma = params.magnet_sigma
        # rows closer together than a magnet's passage see one magnet with one error
        rows = 1.0
        if params.magnet_model == "passage":
            rows = max(1.0, params.passage / max(track.way, 1e-6))
        c, s = math.cos(belief.yaw), math.sin(belief.yaw)
        magnet = self._lattice.nearest(
            belief.x + c * params.bar_x - s * lateral, belief.y + s * params.bar_x + c * lateral
        )
        detection = Detection(
            params.bar_x, lateral, rows * ahead_sigma**2, rows * left_sigma**2, *magnet
        )
        nis = self._engine.weigh(belief, detection).nis
        if nis <= params.gate:
            belief = self._engine.correct(belief, detection)
            return track._replace(belief=belief, nis=nis, rejected_in_row=0)
        in_row = track.rejected_in_row + 1
        if in_row >= params.widen_after:
            belief, in_row = belief.widened(*params.widen_sigma), 0
        return track._replace(
            belief=belief, nis=nis, rejected=track.rejected + 1, rejected_in_row=in_row
        )


def _sane(*values: float) -> bool:
    return all(abs(value) <= ABSURD for value in values)  # False for NaN
