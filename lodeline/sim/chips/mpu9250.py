"""The MPU-9250's gyro, accelerometer and thermometer (InvenSense RM-MPU-9250A, PS-MPU-9250A)."""

from __future__ import annotations

import struct
from collections.abc import Callable
from math import floor, radians

from lodeline.sim.chips.registers import Clock, RegisterChip, Sense, int16

SMPLRT_DIV = 0x19
CONFIG = 0x1A
GYRO_CONFIG = 0x1B
ACCEL_CONFIG = 0x1C
ACCEL_CONFIG2 = 0x1D
INT_PIN_CFG = 0x37
INT_STATUS = 0x3A
ACCEL_XOUT_H = 0x3B
GYRO_ZOUT_L = 0x48
USER_CTRL = 0x6A
PWR_MGMT_1 = 0x6B
WHO_AM_I = 0x75

WRITABLE = frozenset(
    (
        *range(0x13, 0x1F),  # offsets, SMPLRT_DIV, CONFIG, ranges, low-power rate
        *(0x1F, 0x23, 0x24, INT_PIN_CFG, 0x38, 0x68, 0x69, USER_CTRL, PWR_MGMT_1, 0x6C),
        *(0x77, 0x78, 0x7A, 0x7B, 0x7D, 0x7E),  # accelerometer offsets
    )
)
RESET = 0x80
SLEEP = 0x40
BYPASS = 0x02
I2C_MASTER = 0x20
DATA_READY = 0x01
AFTER_RESET = {PWR_MGMT_1: 0x01}
GRAVITY = 9.80665  # m/s^2 in one g
TEMPERATURE_SENSITIVITY = 333.87  # LSB/degC
ROOM = 21.0  # degC at a reading of 0
_DATA = struct.Struct(">7h")


class Mpu9250Chip(RegisterChip):
    """Samples on its own clock, which starts anew at power-on, reset and wake-up."""

    def __init__(
        self,
        clock: Clock,
        angular_velocity: Sense,
        specific_force: Sense,
        temperature: Callable[[float], float],
        identity: int = 0x71,
    ) -> None:
        """Take what it measures, in its own axes: rad/s, m/s^2, degC."""
        super().__init__(clock)
        self._angular_velocity = angular_velocity
        self._specific_force = specific_force
        self._temperature = temperature
        self._identity = identity
        self._registers = bytearray(128)
        self.reset()

    def reset(self) -> None:
        """Lose everything, as a reset or a brown-out does."""
        self._registers = bytearray(128)
        for register, value in AFTER_RESET.items():
            self._registers[register] = value
        self._restart()

    def bypassed(self) -> bool:
        """Tell whether the magnetometer's bus is switched through to ours."""
        registers = self._registers
        return bool(registers[INT_PIN_CFG] & BYPASS) and not registers[USER_CTRL] & I2C_MASTER

    @property
    def sample_rate(self) -> float:
        """Samples per second: the divider works on 1 kHz, and not without the low-pass filter."""
        filtered = not self._registers[GYRO_CONFIG] & 0x03
        if not filtered:
            return 32000.0
        if self._registers[CONFIG] & 0x07 in (0, 7):
            return 8000.0
        return 1000.0 / (1 + self._registers[SMPLRT_DIV])

    def _restart(self) -> None:
        self._epoch = self._clock()
        self._sampled = 0

    def _begin(self, now: float) -> None:
        if self._registers[PWR_MGMT_1] & SLEEP:
            return
        sample = floor((now - self._epoch) * self.sample_rate + 1e-6)
        if sample > self._sampled:
            self._sampled = sample
            self._sample(self._epoch + sample / self.sample_rate)
            self._registers[INT_STATUS] |= DATA_READY

    def _sample(self, t: float) -> None:
        gyro_range = 250 << (self._registers[GYRO_CONFIG] >> 3 & 3)
        accel_range = 2 << (self._registers[ACCEL_CONFIG] >> 3 & 3)
        per_rate = 32768.0 / radians(gyro_range)
        per_force = 32768.0 / (accel_range * GRAVITY)
        values = [int16(f * per_force) for f in self._specific_force(t)]
        values.append(int16((self._temperature(t) - ROOM) * TEMPERATURE_SENSITIVITY))
        values += [int16(w * per_rate) for w in self._angular_velocity(t)]
        self._registers[ACCEL_XOUT_H : GYRO_ZOUT_L + 1] = _DATA.pack(*values)

    def _get(self, register: int) -> int:
        if register == WHO_AM_I:
            return self._identity
        if register > 0x7F:
            return 0
        value = self._registers[register]
        if register == INT_STATUS:
            self._registers[INT_STATUS] = 0
        return value

    def _set(self, register: int, value: int) -> None:
        if register not in WRITABLE:
            return
        if register == PWR_MGMT_1 and value & RESET:
            self.reset()
            return
        woken = register == PWR_MGMT_1 and self._registers[register] & ~value & SLEEP
        changed = register in (SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG)
        retimed = changed and self._registers[register] != value
        self._registers[register] = value
        if woken or retimed:
            self._restart()
