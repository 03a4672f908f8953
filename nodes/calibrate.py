"""Calibrate: raw chip readings in, body readings out, corrected by what is known of the chip."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.calibration_file import CalibrationFileError, calibrated, calibrated_by
from lodeline.node import CalibrationInUse, Input, Node, Output
from lodeline_msgs import Imu, MagneticField


@dataclass(frozen=True, slots=True)
class CalibrateParams(ImuCalibration):
    """The numbers themselves, or the file of `lodeline calibrate` whose numbers go before them.

    With a `chip`, a file made for another one (see `lodeline calibrate --chip`) is refused.
    """

    file: Annotated[str, "YAML, its path from where `lodeline up` is called"] = ""
    chip: Annotated[str, "the name that you gave to this very sensor"] = ""


class Calibrate(Node[CalibrateParams]):
    """Takes out offsets, scale errors, hard and soft iron; turns chip axes into body axes."""

    data_raw = Input(Imu, queue=256, max_age=0.25)
    mag_raw = Input(MagneticField, queue=32, max_age=0.25)
    data = Output(Imu)
    mag = Output(MagneticField)

    def setup(self) -> None:
        self.calibrator: Calibrator | None = None
        self.file = str(Path(self.params.file).expanduser().resolve()) if self.params.file else ""
        try:
            calibration, note = calibrated(self.params, self.params.file)
        except CalibrationFileError as error:
            self.context.report("fault", str(error))
            return
        self.calibrator = Calibrator(calibration)
        if note:
            self.context.report("degraded", note)

    @data_raw.handler
    def on_data(self, raw: Imu) -> None:
        if self.calibrator is None:
            self.context.reject("no calibration")
            return
        self.data.send(
            Imu(
                raw.stamp,
                self.calibrator.angular_velocity(raw.angular_velocity),
                self.calibrator.linear_acceleration(raw.linear_acceleration),
            )
        )

    @mag_raw.handler
    def on_mag(self, raw: MagneticField) -> None:
        if self.calibrator is None:
            self.context.reject("no calibration")
            return
        self.mag.send(MagneticField(raw.stamp, self.calibrator.magnetic_field(raw.magnetic_field)))

    def calibrate(self, data: bytes) -> CalibrationInUse:
        known = self.calibrator.calibration if self.calibrator else ImuCalibration()
        if data:
            self.calibrator = Calibrator(calibrated_by(self.params, data))
            self.context.report("running", "")
        return CalibrationInUse(asdict(known), self.file)


if __name__ == "__main__":
    from lodeline.process import run

    run(Calibrate)
