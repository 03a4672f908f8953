"""Calibration of gyro, accelerometer and magnetometer: applying it, and finding it."""

from lodeline.calibration.apply import Calibrator, ImuCalibration

__all__ = ["Calibrator", "ImuCalibration"]
