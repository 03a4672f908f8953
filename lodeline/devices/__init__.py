"""Drivers of the sensors on an I2C bus: register contents in, physical quantities out."""

from lodeline.devices.ak8963 import Ak8963, Ak8963Params
from lodeline.devices.as5048b import Encoders, EncodersParams, EncodersState
from lodeline.devices.link import DeviceError, Health
from lodeline.devices.mpu9250 import ImuReading, Mpu9250, Mpu9250Params
from lodeline.devices.reed_bar import ReedBar, ReedBarParams

__all__ = [
    "Ak8963",
    "Ak8963Params",
    "DeviceError",
    "Encoders",
    "EncodersParams",
    "EncodersState",
    "Health",
    "ImuReading",
    "Mpu9250",
    "Mpu9250Params",
    "ReedBar",
    "ReedBarParams",
]
