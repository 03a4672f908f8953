"""The gyro, accelerometer and thermometer of an MPU-9250 and its relatives.

Register names and scales are those of InvenSense's register maps RM-MPU-9250A, RM-MPU-6500A and
RM-MPU-6000A. Values come in the chip's axes, which are FLU when it is mounted x forward and z up;
turning them is the business of the calibration. At +-2 g, 16384 LSB are 1 g, so 8192 LSB are 0.5 g
and not the 1 g that (1) of the DCM paper prints.
"""

from __future__ import annotations

import contextlib
import struct
from math import radians
from typing import ClassVar, NamedTuple

from lodeline.devices.guard import Guard
from lodeline.devices.link import DeviceError, Health, Link
from lodeline.devices.mpu_models import MODELS, MpuParams
from lodeline.i2c import Bus

SMPLRT_DIV = 0x19
FIFO_EN = 0x23
INT_PIN_CFG = 0x37  # INT_ENABLE, one that tells nothing and INT_STATUS follow
USER_CTRL = 0x6A
PWR_MGMT_1 = 0x6B
WHO_AM_I = 0x75

RESET = 0x80
CLOCK_AUTO = 0x01
PINS = 0x22  # the magnetometer onto our bus; flags stay until INT_STATUS is read
FLAGS = 0x11  # data ready and FIFO overflow; on the older chips they stay 0 unless enabled
DATA_READY = 0x01
KEEP_OLD = 0x40  # a full FIFO takes no more; the older chips cannot
GRAVITY = 9.80665  # m/s^2 in one g
GYRO_CODES = {250: 0, 500: 1, 1000: 2, 2000: 3}
ACCEL_CODES = {2: 0, 4: 1, 8: 2, 16: 3}
BANDWIDTHS = {1: 184.0, 2: 92.0, 3: 41.0, 4: 20.0, 5: 10.0, 6: 5.0}  # Hz of the gyro, by DLPF_CFG
FULL_SCALE = 32768.0  # LSB
RESET_TIME = 0.1  # s
START_TIME = 0.035  # s, of the gyro
CHECK_PERIOD = 0.1  # s
_BURST = struct.Struct(">7h")


class ImuReading(NamedTuple):
    """One sample: rad/s, m/s^2 (specific force, +9.81 on z at rest) and degC, in chip axes."""

    angular_velocity: tuple[float, float, float]
    linear_acceleration: tuple[float, float, float]
    temperature: float


class Mpu:
    """The driver. Construction probes: DeviceError if a chip answers that is not the one declared.

    A chip that does not answer is no error: `read` returns None and `health` says why until it
    does. So is a chip that resets in flight: not one reading of it gets out, and it is set up
    again.
    """

    fifo_parts: ClassVar[int] = 0x00  # what goes into the FIFO
    user_control: ClassVar[int] = 0x00

    def __init__(self, bus: Bus, params: MpuParams | None = None, name: str = "imu") -> None:
        self.params = params = params if params is not None else MpuParams()
        self.model = MODELS["mpu9250" if params.chip == "auto" else params.chip]
        self.bus = bus
        self.name = name
        self._rate_per_lsb = radians(params.gyro_range) / FULL_SCALE
        self._force_per_lsb = params.accel_range * GRAVITY / FULL_SCALE
        self._check_s = float("-inf")
        stages = (self._reset, self._wake, self._configure, self._start)
        self.link = Link(name, bus, params.address, stages)
        ranges, bandwidth = (params.gyro_range, params.accel_range), BANDWIDTHS[params.dlpf]
        self.guard = Guard(name, self.link.health, ranges, bandwidth, params.sample_rate)
        with contextlib.suppress(OSError):  # read() brings it up once it answers
            if bus.fd is None:
                bus.reopen()
            self._identify()

    @property
    def health(self) -> Health:
        """How the chip does."""
        return self.link.health

    @property
    def delay(self) -> float:
        """How long ago that was, at the time of a sample, which its gyro tells [s]."""
        return self.model.gyro_delays[self.params.dlpf - 1]

    def read(self, now_s: float) -> ImuReading | None:
        """Return a reading taken now, at the monotonic `now_s` [s], or None if there is none."""
        if not self.ready(now_s):
            return None
        raw = self.link.attempt(now_s, self._burst)
        if raw is None or self.forgot(now_s, raw[0]):
            return None
        if not raw[3] & DATA_READY:
            self.guard.nothing(now_s)
            return None
        data = bytes(raw[4:])
        return self.decode(data) if self.guard.passes(now_s, data) else None

    def ready(self, now_s: float) -> bool:
        """Tell whether the chip is up and set; every 0.1 s its registers are looked at."""
        link = self.link
        was_up = link.up
        if not link.ready(now_s):
            return False
        if not was_up:
            self.guard.alive(now_s)
        if now_s < self._check_s:
            return True
        self._check_s = now_s + CHECK_PERIOD
        configured = link.attempt(now_s, self._is_configured)
        if configured is False:
            self._lost(now_s)
        return configured is True

    def forgot(self, now_s: float, pin_config: int) -> bool:
        """Tell by INT_PIN_CFG, which is 0 after a reset, whether the chip is as it was set.

        It is read together with the data: so data of another scale are known as such at once.
        """
        if pin_config != PINS:
            self._lost(now_s)
        return pin_config != PINS

    def decode(self, data: bytes) -> ImuReading:
        """Turn the 14 bytes of one sample into quantities."""
        ax, ay, az, temperature, gx, gy, gz = _BURST.unpack(data)
        force, rate = self._force_per_lsb, self._rate_per_lsb
        return ImuReading(
            (gx * rate, gy * rate, gz * rate),
            (ax * force, ay * force, az * force),
            temperature * self.model.degrees_per_lsb + self.model.degrees_at_0,
        )

    def _lost(self, now_s: float) -> None:
        self.link.lost(now_s, f"IMU_RESET {self.name}: registers lost, reconfigured")
        self.link.ready(now_s)

    def _burst(self) -> list[int]:
        # from INT_PIN_CFG over INT_STATUS to the end of the data
        return self.bus.read_i2c_block_data(self.params.address, INT_PIN_CFG, 18)

    @property
    def _settings(self) -> tuple[int, ...]:
        """What goes into SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG and ACCEL_CONFIG2."""
        p = self.params
        settings = (
            p.divider - 1,
            p.dlpf | KEEP_OLD * (p.fifo and self.model.accel_filter),
            GYRO_CODES[p.gyro_range] << 3,
            ACCEL_CODES[p.accel_range] << 3,
            p.dlpf,
        )
        return settings if self.model.accel_filter else settings[:4]

    def _identify(self) -> None:
        got = self.bus.read_byte_data(self.params.address, WHO_AM_I)
        if got == self.model.identity:
            return
        alike = [model for model in MODELS.values() if model.identity == got]
        if self.params.chip == "auto" and alike:
            self.model = alike[0]
            return
        what = " or ".join(model.name for model in alike) or "unknown chip"
        wanted = f"0x{self.model.identity:02x} ({self.model.name})"
        if self.params.chip == "auto":
            wanted = ", ".join(sorted({f"0x{model.identity:02x}" for model in MODELS.values()}))
        where = f"at 0x{self.params.address:02x}"
        fix = "take `chip: auto`, or another board" if alike else "another chip, or a bad contact"
        text = f"got 0x{got:02x} ({what}), expected {wanted} {where}"
        raise DeviceError(f"IMU_ID {self.name}: {text} - {fix}")

    def _reset(self) -> float:
        self._identify()
        self.bus.write_byte_data(self.params.address, PWR_MGMT_1, RESET)
        return RESET_TIME

    def _wake(self) -> float:
        self.bus.write_byte_data(self.params.address, PWR_MGMT_1, CLOCK_AUTO)
        return START_TIME

    def _configure(self) -> float:
        bus, address = self.bus, self.params.address
        bus.write_i2c_block_data(address, SMPLRT_DIV, list(self._settings))
        bus.write_byte_data(address, FIFO_EN, self.fifo_parts)
        bus.write_byte_data(address, USER_CTRL, self.user_control)  # its own I2C master off
        bus.write_i2c_block_data(address, INT_PIN_CFG, [PINS, FLAGS])
        if not self._is_configured():
            raise DeviceError(f"IMU_SETTINGS {self.name}: the chip does not keep its settings")
        return START_TIME

    def _start(self) -> float:
        """What is to be done once the sensors have started; here nothing."""
        return 0.0

    def _is_configured(self) -> bool:
        bus, address, settings = self.bus, self.params.address, self._settings
        kept = bus.read_i2c_block_data(address, SMPLRT_DIV, FIFO_EN - SMPLRT_DIV + 1)
        return (
            (*kept[: len(settings)], kept[-1]) == (*settings, self.fifo_parts)
            and bus.read_i2c_block_data(address, INT_PIN_CFG, 2) == [PINS, FLAGS]
            and bus.read_i2c_block_data(address, USER_CTRL, 2) == [self.user_control, CLOCK_AUTO]
        )
