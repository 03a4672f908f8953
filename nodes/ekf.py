"""Localisation: odometry and floor magnets fused into one pose with its covariance."""

from __future__ import annotations

from lodeline.ekf import Estimate, Localizer, LocalizerParams, LocalizerState, sightings
from lodeline.node import Input, Node, Output
from lodeline_msgs import (
    AttitudeEstimate,
    LandmarkDetection,
    MagnetDetection,
    Odometry,
    PoseEstimate,
    PositionFix,
)


class EkfNode(Node[LocalizerParams]):
    """`odom` in; a `pose` out for each, and at once for what corrects it: as far as connected,
    `magnets` in the floor, `landmarks` of the map, a measured `position`.

    `attitude` tells how the robot turns even if a wheel slips.
    """

    State = LocalizerState
    odom = Input(Odometry, queue=256, max_age=0.5)
    magnets = Input(MagnetDetection, queue=256, max_age=0.5)
    attitude = Input(AttitudeEstimate, queue=256, max_age=0.5)
    landmarks = Input(LandmarkDetection, queue=256, max_age=0.5)
    position = Input(PositionFix, queue=256, max_age=0.5)
    pose = Output(PoseEstimate)

    def setup(self) -> None:
        self.localizer = Localizer(self.params)

    @odom.handler
    def on_odom(self, odom: Odometry) -> None:
        self._send(
            self.localizer.odometry(
                odom.stamp,
                odom.x,
                odom.y,
                odom.yaw,
                odom.twist_covariance,
                odom.interval,
                odom.resets,
            )
        )

    @magnets.handler
    def on_magnets(self, detection: MagnetDetection) -> None:
        """A reading newer than the odometry waits for it; one without magnets tells no pose."""
        self._send(self.localizer.magnets(detection.stamp, detection.lateral))

    @landmarks.handler
    def on_landmarks(self, seen: LandmarkDetection) -> None:
        try:
            marks = sightings(
                seen.x, seen.y, seen.range, seen.range_std, seen.bearing, seen.bearing_std
            )
        except ValueError:
            self.context.reject("malformed")
            return
        self._send(self.localizer.landmarks(seen.stamp, marks))

    @position.handler
    def on_position(self, fix: PositionFix) -> None:
        self._send(self.localizer.position(fix.stamp, fix.x, fix.y, fix.std))

    @attitude.handler
    def on_attitude(self, attitude: AttitudeEstimate) -> None:
        """It tells in the next pose what it changed."""
        self.localizer.attitude(
            attitude.stamp,
            attitude.orientation,
            attitude.angular_velocity,
            attitude.heading_std,
            disturbed=attitude.disturbed,
        )

    def _send(self, estimate: Estimate | None) -> None:
        rejected = self.context.rejected
        rejected["too old"] = self.localizer.late
        rejected["same stamp"] = self.localizer.duplicates
        rejected["absurd"] = self.localizer.refused
        if estimate is None:
            return
        rejected["gate"] = estimate.rejected
        self.context.report("degraded" if estimate.trouble else "running", estimate.trouble)
        self.pose.send(
            PoseEstimate(
                stamp=estimate.stamp_ns,
                x=estimate.x,
                y=estimate.y,
                yaw=estimate.yaw,
                covariance=estimate.covariance,
                nis=estimate.nis,
                rejected=estimate.rejected,
                ambiguous=estimate.ambiguous,
            )
        )

    def save(self) -> LocalizerState:
        return self.localizer.state

    def resume(self, state: LocalizerState) -> None:
        self.localizer.resume(state)


if __name__ == "__main__":
    from lodeline.process import run

    run(EkfNode)
