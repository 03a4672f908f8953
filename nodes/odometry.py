"""Wheel odometry: counts of two encoders to a pose that drifts but never jumps."""

from __future__ import annotations

from dataclasses import asdict

from lodeline import odometry
from lodeline.calibration_file import calibrated_by
from lodeline.node import CalibrationInUse, Input, Node, Output
from lodeline.odometry import OdometryParams, OdometryState
from lodeline_msgs import Odometry, WheelTicks


class OdometryNode(Node[OdometryParams]):
    """`wheels` in, `odom` out, one for one."""

    State = OdometryState
    wheels = Input(WheelTicks, queue=256, max_age=0.5)
    odom = Output(Odometry)

    def setup(self) -> None:
        self.drive = self.params
        self.odometry = odometry.Odometry(self.drive)

    @wheels.handler
    def on_wheels(self, ticks: WheelTicks) -> None:
        """A reading whose time does not advance leads to nothing."""
        estimate = self.odometry.update(ticks.stamp, ticks.left, ticks.right)
        if estimate is None:
            self.context.reject("time stands still")
            return
        self.odom.send(
            Odometry(
                stamp=estimate.stamp_ns,
                x=estimate.x,
                y=estimate.y,
                yaw=estimate.yaw,
                v=estimate.v,
                w=estimate.w,
                pose_covariance=estimate.covariance,
                twist_covariance=estimate.twist_covariance,
                interval=estimate.interval,
                resets=estimate.resets,
            )
        )

    def save(self) -> OdometryState:
        return self.odometry.state

    def resume(self, state: OdometryState) -> None:
        self.odometry.resume(state)

    def calibrate(self, data: bytes) -> CalibrationInUse:
        """The pose stays: the new lengths hold for the way from here on."""
        known = self.drive
        if data:
            self.drive = calibrated_by(self.params, data)
            state, self.odometry = self.odometry.state, odometry.Odometry(self.drive)
            self.odometry.resume(state)
        return CalibrationInUse(asdict(known))


if __name__ == "__main__":
    from lodeline.process import run

    run(OdometryNode)
