"""Calibration of gyro, accelerometer and magnetometer: applying it, and finding it."""

from lodeline.calibration.apply import Calibrator, ImuCalibration
from lodeline.calibration.quality import CalibrationRefusedError

__all__ = ["CalibrationRefusedError", "Calibrator", "ImuCalibration"]
