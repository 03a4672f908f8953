"""Drivers of the sensors on an I2C bus: register contents in, physical quantities out."""

from lodeline.devices.ak8963 import Ak8963, Ak8975, CompassParams
from lodeline.devices.as5048b import Encoders, EncodersParams, EncodersState
from lodeline.devices.board import ImuBoard
from lodeline.devices.link import STATES, DeviceError, Health
from lodeline.devices.mpu import ImuReading, Mpu
from lodeline.devices.mpu_fifo import MpuFifo, check_rate
from lodeline.devices.mpu_models import MpuParams
from lodeline.devices.reed_bar import ReedBar, ReedBarParams

__all__ = [
    "STATES",
    "Ak8963",
    "Ak8975",
    "CompassParams",
    "DeviceError",
    "Encoders",
    "EncodersParams",
    "EncodersState",
    "Health",
    "ImuBoard",
    "ImuReading",
    "Mpu",
    "MpuFifo",
    "MpuParams",
    "ReedBar",
    "ReedBarParams",
    "check_rate",
]
