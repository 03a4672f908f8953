"""Calibrate: raw chip readings in, body readings out, corrected by what is known of the chip."""

from __future__ import annotations

from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.node import Input, Node, Output
from lodeline_msgs import Imu, MagneticField


class Calibrate(Node[ImuCalibration]):
    """Takes out offsets, scale errors, hard and soft iron; turns chip axes into body axes."""

    data_raw = Input(Imu, queue=32, max_age=0.25)
    mag_raw = Input(MagneticField, queue=4, max_age=0.25)
    data = Output(Imu)
    mag = Output(MagneticField)

    def setup(self) -> None:
        self.calibrator = Calibrator(self.params)

    @data_raw.handler
    def on_data(self, raw: Imu) -> None:
        self.data.send(
            Imu(
                raw.stamp,
                self.calibrator.angular_velocity(raw.angular_velocity),
                self.calibrator.linear_acceleration(raw.linear_acceleration),
            )
        )

    @mag_raw.handler
    def on_mag(self, raw: MagneticField) -> None:
        self.mag.send(MagneticField(raw.stamp, self.calibrator.magnetic_field(raw.magnetic_field)))


if __name__ == "__main__":
    from lodeline.process import run

    run(Calibrate)
