"""The MPU-9250 and its relatives: what tells them apart, and how they may be set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

GYRO_DELAYS = (2.9e-3, 3.9e-3, 5.9e-3, 9.9e-3, 17.85e-3, 33.48e-3)  # s, for DLPF_CFG 1 to 6
OLD_GYRO_DELAYS = (1.9e-3, 2.8e-3, 4.8e-3, 8.3e-3, 13.4e-3, 18.6e-3)


class Model(NamedTuple):
    """One of these chips. `accel_filter`: the accelerometer has a filter of its own."""

    identity: int  # WHO_AM_I
    name: str
    compass: Literal["AK8963", "AK8975", ""] = ""
    accel_filter: bool = True
    degrees_per_lsb: float = 1.0 / 333.87
    degrees_at_0: float = 21.0
    fifo_size: int = 512  # bytes
    gyro_delays: tuple[float, ...] = GYRO_DELAYS


MODELS = {
    "mpu9250": Model(0x71, "MPU-9250", "AK8963"),
    "mpu9255": Model(0x73, "MPU-9255", "AK8963"),
    "mpu9150": Model(0x68, "MPU-9150", "AK8975", False, 1.0 / 340.0, 36.53, 1024, OLD_GYRO_DELAYS),
    "mpu6500": Model(0x70, "MPU-6500: no magnetometer"),
    "mpu6050": Model(
        0x68, "MPU-6050: no magnetometer", "", False, 1.0 / 340.0, 36.53, 1024, OLD_GYRO_DELAYS
    ),
}


@dataclass(frozen=True, slots=True)
class MpuParams:
    """Where the chip is and how it measures.

    `chip: auto` takes any that is known, and a name refuses all others (MPU-6050 and 9150 say the
    same of themselves). `dlpf` is DLPF_CFG for gyro and accelerometer alike: 1 to 6 stand for a
    gyro bandwidth of 184, 92, 41, 20, 10 and 5 Hz. The lower it is, the later the filter tells of a
    motion: by 3, 4, 6, 10, 18 and 33 ms. Stamps are earlier by that; the accelerometer's delay is
    another one, up to twice as long.
    `sample_rate` is the chip's own, 1000 Hz or a whole fraction of it; reading slower than it
    samples costs nothing and keeps what is read fresh. With `fifo` every one of its samples is read
    (see mpu_fifo).
    """

    chip: Literal["auto", "mpu9250", "mpu9255", "mpu9150", "mpu6500", "mpu6050"] = "auto"
    address: Annotated[int, "1"] = 0x68
    gyro_range: Annotated[Literal[250, 500, 1000, 2000], "deg/s"] = 500
    accel_range: Annotated[Literal[2, 4, 8, 16], "g"] = 4
    dlpf: Annotated[Literal[1, 2, 3, 4, 5, 6], "1"] = 2
    sample_rate: Annotated[float, "Hz"] = 1000.0
    fifo: Annotated[bool, "1"] = False

    def __post_init__(self) -> None:
        whole = 1 <= self.divider <= 256
        if not whole or abs(self.divider * self.sample_rate - 1000.0) > 1e-3:
            raise ValueError(f"sample_rate is 1000 Hz / 1..256, not {self.sample_rate:g} Hz")

    @property
    def divider(self) -> int:
        """What divides the chip's 1 kHz; 0 if the rate makes no sense."""
        return round(1000.0 / self.sample_rate) if self.sample_rate > 0.0 else 0
