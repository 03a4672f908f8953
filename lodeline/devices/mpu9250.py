"""The MPU-9250's gyro, accelerometer and thermometer.

Register names and scales are those of InvenSense's register map RM-MPU-9250A. Values come in the
chip's axes, which are FLU when it is mounted x forward and z up; turning them is the business of
the calibration.
"""

from __future__ import annotations

import contextlib
import struct
from dataclasses import dataclass
from math import radians
from typing import Annotated, Literal, NamedTuple

from lodeline.devices.link import DeviceError, Health, Link
from lodeline.i2c import Bus

SMPLRT_DIV = 0x19
CONFIG = 0x1A
INT_PIN_CFG = 0x37
ACCEL_XOUT_H = 0x3B
USER_CTRL = 0x6A
PWR_MGMT_1 = 0x6B
WHO_AM_I = 0x75

RESET = 0x80
CLOCK_AUTO = 0x01
BYPASS = 0x02
IDENTITY = 0x71
KNOWN = {
    0x68: "MPU-6050 or MPU-9150",
    0x70: "MPU-6500: no magnetometer",
    0x71: "MPU-9250",
    0x73: "MPU-9255",
    0x98: "ICM-20689",
}
GRAVITY = 9.80665  # m/s^2 in one g
GYRO_CODES = {250: 0, 500: 1, 1000: 2, 2000: 3}
ACCEL_CODES = {2: 0, 4: 1, 8: 2, 16: 3}
FULL_SCALE = 32768.0  # LSB
TEMPERATURE_SENSITIVITY = 333.87  # LSB/degC
ROOM = 21.0  # degC at a reading of 0
RESET_TIME = 0.1  # s
START_TIME = 0.035  # s, of the gyro
CHECK_PERIOD = 0.1  # s
_BURST = struct.Struct(">7h")


@dataclass(frozen=True, slots=True)
class Mpu9250Params:
    """Where the chip is and how it measures.

    `dlpf` is DLPF_CFG for gyro and accelerometer alike: 1 to 6 stand for a gyro bandwidth of 184,
    92, 41, 20, 10 and 5 Hz. `sample_rate` is the chip's own, 1000 Hz or a whole fraction of it;
    reading slower than it samples costs nothing and keeps what is read fresh.
    """

    address: Annotated[int, "1"] = 0x68
    gyro_range: Annotated[Literal[250, 500, 1000, 2000], "deg/s"] = 500
    accel_range: Annotated[Literal[2, 4, 8, 16], "g"] = 4
    dlpf: Annotated[Literal[1, 2, 3, 4, 5, 6], "1"] = 2
    sample_rate: Annotated[float, "Hz"] = 1000.0

    def __post_init__(self) -> None:
        whole = 1 <= self.divider <= 256
        if not whole or abs(self.divider * self.sample_rate - 1000.0) > 1e-3:
            raise ValueError(f"sample_rate is 1000 Hz / 1..256, not {self.sample_rate:g} Hz")

    @property
    def divider(self) -> int:
        """What divides the chip's 1 kHz; 0 if the rate makes no sense."""
        return round(1000.0 / self.sample_rate) if self.sample_rate > 0.0 else 0


class ImuReading(NamedTuple):
    """One burst: rad/s, m/s^2 (specific force, +9.81 on z at rest) and degC, in chip axes."""

    angular_velocity: tuple[float, float, float]
    linear_acceleration: tuple[float, float, float]
    temperature: float


class Mpu9250:
    """The driver. Construction probes: DeviceError if another chip answers than an MPU-9250.

    A chip that does not answer is no error: `read` returns None and `health` says why until it
    does. So is a chip that resets in flight: that is noticed within 0.1 s and it is set up again.
    """

    def __init__(self, bus: Bus, params: Mpu9250Params | None = None, name: str = "imu") -> None:
        params = params if params is not None else Mpu9250Params()
        self._bus = bus
        self._address = params.address
        self._name = name
        self._settings = (  # of SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG2
            params.divider - 1,
            params.dlpf,
            GYRO_CODES[params.gyro_range] << 3,
            ACCEL_CODES[params.accel_range] << 3,
            params.dlpf,
        )
        self._rate_per_lsb = radians(params.gyro_range) / FULL_SCALE
        self._force_per_lsb = params.accel_range * GRAVITY / FULL_SCALE
        self._check_s = float("-inf")
        self._link = Link(name, bus, params.address, (self._reset, self._wake, self._configure))
        self._probe()

    @property
    def health(self) -> Health:
        """How the chip does."""
        return self._link.health

    def read(self, now_s: float) -> ImuReading | None:
        """Return a reading taken now, at the monotonic `now_s` [s], or None if there is none."""
        link = self._link
        if not link.ready(now_s):
            return None
        if now_s >= self._check_s:
            self._check_s = now_s + CHECK_PERIOD
            configured = link.attempt(now_s, self._is_configured)
            if configured is False:
                link.lost(now_s, f"IMU_RESET {self._name}: registers lost, reconfigured")
                link.ready(now_s)
            if not configured:
                return None
        raw = link.attempt(now_s, self._burst)
        if raw is None:
            return None
        ax, ay, az, temperature, gx, gy, gz = _BURST.unpack(bytes(raw))
        force, rate = self._force_per_lsb, self._rate_per_lsb
        return ImuReading(
            (gx * rate, gy * rate, gz * rate),
            (ax * force, ay * force, az * force),
            temperature / TEMPERATURE_SENSITIVITY + ROOM,
        )

    def _burst(self) -> list[int]:
        return self._bus.read_i2c_block_data(self._address, ACCEL_XOUT_H, 14)

    def _probe(self) -> None:
        with contextlib.suppress(OSError):  # read() brings it up once it answers
            self._identify()

    def _identify(self) -> None:
        got = self._bus.read_byte_data(self._address, WHO_AM_I)
        if got != IDENTITY:
            what = KNOWN.get(got, "unknown chip")
            text = f"got 0x{got:02x} ({what}), expected 0x{IDENTITY:02x} ({KNOWN[IDENTITY]})"
            raise DeviceError(f"IMU_ID {self._name}: {text} at 0x{self._address:02x}")

    def _reset(self) -> float:
        self._identify()
        self._bus.write_byte_data(self._address, PWR_MGMT_1, RESET)
        return RESET_TIME

    def _wake(self) -> float:
        self._bus.write_byte_data(self._address, PWR_MGMT_1, CLOCK_AUTO)
        return START_TIME

    def _configure(self) -> float:
        bus, address = self._bus, self._address
        bus.write_i2c_block_data(address, SMPLRT_DIV, list(self._settings))
        bus.write_byte_data(address, USER_CTRL, 0x00)  # its own I2C master off
        bus.write_byte_data(address, INT_PIN_CFG, BYPASS)  # the magnetometer onto our bus
        if not self._is_configured():
            raise DeviceError(f"IMU_SETTINGS {self._name}: the chip does not keep its settings")
        return START_TIME

    def _is_configured(self) -> bool:
        bus, address = self._bus, self._address
        return (
            tuple(bus.read_i2c_block_data(address, SMPLRT_DIV, 5)) == self._settings
            and bus.read_byte_data(address, INT_PIN_CFG) == BYPASS
            and bus.read_byte_data(address, PWR_MGMT_1) == CLOCK_AUTO
        )
