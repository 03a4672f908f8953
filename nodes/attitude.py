"""Attitude: calibrated IMU and magnetic field in, orientation out, by the method named."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal

from lodeline.attitude import METHODS
from lodeline.attitude.compass import CompassParams, TiltCompassParams
from lodeline.attitude.complementary import ComplementaryParams
from lodeline.attitude.dcm import DcmParams
from lodeline.attitude.error_state import MekfParams
from lodeline.attitude.gyro import GyroParams
from lodeline.attitude.soft import SoftParams
from lodeline.node import Input, Node, Output
from lodeline.stamps import Steps
from lodeline_msgs import AttitudeEstimate, Imu, MagneticField


@dataclass(frozen=True, slots=True)
class AttitudeNodeParams:
    """The method, and the parameters of each."""

    method: Literal["soft", "mekf", "dcm", "gyro", "compass", "tilt_compass", "complementary"] = (
        "soft"
    )
    soft: SoftParams = field(default_factory=SoftParams)
    mekf: MekfParams = field(default_factory=MekfParams)
    dcm: DcmParams = field(default_factory=DcmParams)
    gyro: GyroParams = field(default_factory=GyroParams)
    compass: CompassParams = field(default_factory=CompassParams)
    tilt_compass: TiltCompassParams = field(default_factory=TiltCompassParams)
    complementary: ComplementaryParams = field(default_factory=ComplementaryParams)


@dataclass(frozen=True, slots=True)
class AttitudeNodeState:
    """Stamp [ns] of the last sample, and the fields of the method's own state in their order."""

    stamp: int | None
    values: tuple[Any, ...]


class AttitudeNode(Node[AttitudeNodeParams]):
    """Starts at once from gravity and north; after a crash, from where its predecessor stood."""

    State = AttitudeNodeState
    data = Input(Imu, queue=256, max_age=0.25)
    mag = Input(MagneticField, queue=32, max_age=0.25)
    attitude = Output(AttitudeEstimate)

    def setup(self) -> None:
        method = self.params.method
        self.filter = METHODS[method](getattr(self.params, method))
        self.steps = Steps()
        self.magnetic_field: tuple[float, float, float] | None = None

    @mag.handler
    def on_mag(self, sample: MagneticField) -> None:
        self.magnetic_field = sample.magnetic_field

    @data.handler
    def on_data(self, sample: Imu) -> None:
        step = self.steps.take(sample.stamp)
        if step is None:
            self.context.reject("stamp not newer")
            return
        magnetic_field, self.magnetic_field = self.magnetic_field, None
        self.filter.update(
            step, sample.angular_velocity, sample.linear_acceleration, magnetic_field
        )
        self.attitude.send(
            AttitudeEstimate(
                sample.stamp,
                self.filter.orientation,
                self.filter.unbiased(sample.angular_velocity),
                self.filter.gyro_bias,
                self.filter.heading_std,
                self.filter.disturbed,
            )
        )

    def save(self) -> AttitudeNodeState:
        state = self.filter.state
        values = tuple(getattr(state, item.name) for item in fields(state))
        return AttitudeNodeState(self.steps.last, values)

    def resume(self, state: AttitudeNodeState) -> None:
        self.filter.resume(self.filter.State(*state.values))
        self.steps.last = state.stamp


if __name__ == "__main__":
    from lodeline.process import run

    run(AttitudeNode)
