"""One EKF step after the other: what a motion and a reading of the bar do to the belief."""

import math
from typing import NamedTuple

from lodeline.ekf.belief import Belief, certain
from lodeline.ekf.engine import Detection, Noise, make_engine
from lodeline.ekf.history import Hits, Motion
from lodeline.ekf.motion import part, relative
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


class Track(NamedTuple):
    """What is carried from sample to sample: the belief and the marks of its detections."""

    belief: Belief
    contacts: tuple[Contact, ...] = ()
    way: float = UNKNOWN_WAY  # of the bar since the last reading of it [m]
    step: float = 0.0  # the part of it along x, signed [m]
    nis: float = 0.0
    rejected: int = 0
    rejected_in_row: int = 0


class Tracker:
    """Pure steps from track to track; the history calls them in the order of stamps."""

    def __init__(self, params: LocalizerParams) -> None:
        self._params = params
        self._engine = make_engine(params.engine)
        self._lattice = Lattice(params.lattice_pitch, *params.lattice_origin)
        self._reeds = ReedModel(params.passage, params.edge_sigma, params.lateral_sigma)

    def start(self) -> Track:
        """The track before any sample."""
        params = self._params
        return Track(certain(*params.initial_pose).widened(*params.initial_sigma))

    def lost(self, track: Track, share: float = 1.0) -> Track:
        """After a time in which nobody measured where the robot went (or a share of it)."""
        doubt = math.sqrt(share)
        position, heading = self._params.reset_sigma
        return track._replace(
            belief=track.belief.widened(doubt * position, doubt * heading),
            contacts=(),
            way=UNKNOWN_WAY,
            step=0.0,
        )

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
            return self.lost(track, share)
        if share < 1.0:
            delta = part(delta, begin, end)
        belief = self._engine.predict(track.belief, delta, self._noise(after, seconds * share))
        way = math.hypot(delta.ahead, delta.left + params.bar_x * delta.turn)
        return track._replace(belief=belief, way=track.way + way, step=track.step + delta.ahead)

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
        contacts: tuple[Contact, ...] = ()
        if self._params.magnet_model == "plain":
            sights = plain_sights(self._reeds, hits.laterals)
        else:
            sights, contacts = edge_sights(
                self._reeds, track.contacts, hits.laterals, track.way, track.step
            )
        for sight in sights:
            track = self._detect(track, sight)
        return track._replace(contacts=contacts, way=0.0, step=0.0)

    def _detect(self, track: Track, sight: Sight) -> Track:
        params, belief = self._params, track.belief
        ahead, lateral = params.bar_x + sight.offset, sight.lateral
        c, s = math.cos(belief.yaw), math.sin(belief.yaw)
        magnet = self._lattice.nearest(
            belief.x + c * ahead - s * lateral, belief.y + s * ahead + c * lateral
        )
        detection = Detection(ahead, lateral, sight.ahead_variance, sight.left_variance, *magnet)
        nis = self._engine.weigh(belief, detection).nis
        if nis <= params.gate:
            belief = self._engine.correct(belief, detection).positive()
            return track._replace(belief=belief, nis=nis, rejected_in_row=0)
        in_row = track.rejected_in_row + 1
        if in_row >= params.widen_after:
            belief, in_row = belief.widened(*params.widen_sigma), 0
        return track._replace(
            belief=belief, nis=nis, rejected=track.rejected + 1, rejected_in_row=in_row
        )
