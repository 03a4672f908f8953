"""InvenSense's MPU-6050, 6500, 9150, 9250 and 9255: gyro, accelerometer, thermometer, FIFO.

After the register maps RM-MPU-6000A, RM-MPU-6500A and RM-MPU-9250A and the product
specifications. The magnetometer of a nine-axis chip is a chip of its own (see ak8963).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from math import floor, radians

from lodeline.sim.chips.mpu_timing import OLD, delays, sample_rate
from lodeline.sim.chips.registers import Clock, RegisterChip, Sense, int16

SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG2 = 0x19, 0x1A, 0x1B, 0x1C, 0x1D
FIFO_EN = 0x23
INT_PIN_CFG, INT_ENABLE, INT_STATUS = 0x37, 0x38, 0x3A
ACCEL_XOUT_H, GYRO_ZOUT_L = 0x3B, 0x48
USER_CTRL, PWR_MGMT_1 = 0x6A, 0x6B
FIFO_COUNT_H, FIFO_COUNT_L, FIFO_R_W = 0x72, 0x73, 0x74
WHO_AM_I = 0x75

WRITABLE = frozenset(
    (
        *range(0x13, 0x1F),  # offsets, SMPLRT_DIV, CONFIG, ranges, low-power rate
        *(0x1F, FIFO_EN, INT_PIN_CFG, INT_ENABLE, 0x68, 0x69, USER_CTRL, PWR_MGMT_1, 0x6C),
        *(0x77, 0x78, 0x7A, 0x7B, 0x7D, 0x7E),  # accelerometer offsets
    )
)
RESET, SLEEP = 0x80, 0x40  # of PWR_MGMT_1
BYPASS = 0x02
FIFO_ON, I2C_MASTER, FIFO_RESET = 0x40, 0x20, 0x04  # of USER_CTRL
KEEP_OLD = 0x40  # of CONFIG: a full FIFO takes no more, instead of losing its oldest
DATA_READY, FIFO_OVERFLOW = 0x01, 0x10
# what each bit of FIFO_EN puts in: bytes of the data registers, in their order
FIFO_PARTS = ((0x08, 0, 6), (0x80, 6, 8), (0x40, 8, 10), (0x20, 10, 12), (0x10, 12, 14))
GRAVITY = 9.80665  # m/s^2 in one g
START_TIME = 0.035  # s, of the gyro after power-up or sleep
DEAF_TIME = 0.011  # s without an answer after power-up
_DATA = struct.Struct(">7h")


class MpuChip(RegisterChip):
    """Samples on its own clock, which starts anew at power-on, reset and wake-up."""

    def __init__(
        self,
        clock: Clock,
        angular_velocity: Sense,
        specific_force: Sense,
        temperature: Callable[[float], float],
        identity: int = 0x71,
        clock_error: float = 0.0,
    ) -> None:
        """Take what it measures, in its own axes: rad/s, m/s^2, degC.

        `identity` is its WHO_AM_I, which says what it is. `clock_error` is the part by which it
        samples too fast.
        """
        super().__init__(clock)
        self._angular_velocity = angular_velocity
        self._specific_force = specific_force
        self._temperature = temperature
        self._identity = identity
        self._pace = 1.0 + clock_error
        self._deaf_until = float("-inf")
        self.fifo_size = 1024 if identity in OLD else 512
        self.reset()

    def reset(self) -> None:
        """Lose everything, as a reset or a brown-out does."""
        self._registers = bytearray(128)
        self._registers[PWR_MGMT_1] = SLEEP if self._identity in OLD else 0x01
        self._fifo = bytearray()
        self._woken = self._clock()
        self._restart()

    def power_cycle(self) -> None:
        """Come up from no power at all: for a while nobody answers."""
        self.reset()
        self._deaf_until = self._clock() + DEAF_TIME

    def acknowledges(self) -> bool:
        """Answer, except for a moment after power-up."""
        return self._clock() >= self._deaf_until

    def bypassed(self) -> bool:
        """Tell whether the magnetometer's bus is switched through to ours."""
        registers = self._registers
        return bool(registers[INT_PIN_CFG] & BYPASS) and not registers[USER_CTRL] & I2C_MASTER

    @property
    def sample_rate(self) -> float:
        """Samples per second of true time [Hz]."""
        return self._pace * sample_rate(self._identity, self._registers)

    def _restart(self) -> None:
        self._epoch = self._clock()
        self._sampled = 0

    def _begin(self, now: float) -> None:
        registers = self._registers
        if registers[PWR_MGMT_1] & SLEEP:
            return
        rate = self.sample_rate
        newest = floor((now - self._epoch) * rate + 1e-6)
        if newest == self._sampled:
            return
        kept = self._fifo_room() if registers[USER_CTRL] & FIFO_ON and self._frame() else 1
        first = self._sampled + 1
        if not registers[CONFIG] & KEEP_OLD:
            first = max(first, newest - kept + 1)
        for sample in range(first, min(newest, first + kept - 1) + 1):
            self._sample(self._epoch + sample / rate)
        if newest > first + kept - 1:
            self._sample(self._epoch + newest / rate)
        self._sampled = newest
        self._flag(DATA_READY)

    def _fifo_room(self) -> int:
        """Samples that one look after a long time must go through: as many as may be kept."""
        return self.fifo_size // len(self._frame()) + 2

    def _sample(self, t: float) -> None:
        gyro_range = 250 << (self._registers[GYRO_CONFIG] >> 3 & 3)
        accel_range = 2 << (self._registers[ACCEL_CONFIG] >> 3 & 3)
        per_rate = 32768.0 / radians(gyro_range)
        per_force = 32768.0 / (accel_range * GRAVITY)
        gyro_delay, accel_delay = delays(self._identity, self._registers)
        values = [int16(f * per_force) for f in self._specific_force(t - accel_delay)]
        values.append(int16(self._thermometer(self._temperature(t))))
        started = t >= self._woken + START_TIME
        values += [
            int16(w * per_rate) if started else 0 for w in self._angular_velocity(t - gyro_delay)
        ]
        self._registers[ACCEL_XOUT_H : GYRO_ZOUT_L + 1] = _DATA.pack(*values)
        if self._registers[USER_CTRL] & FIFO_ON:
            self._push(self._frame())

    def _thermometer(self, degrees: float) -> float:
        if self._identity in OLD:
            return (degrees - 36.53) * 340.0
        return (degrees - 21.0) * 333.87

    def _frame(self) -> bytes:
        """What one sample puts into the FIFO."""
        data = self._registers[ACCEL_XOUT_H : GYRO_ZOUT_L + 1]
        chosen = self._registers[FIFO_EN]
        return b"".join(bytes(data[begin:end]) for bit, begin, end in FIFO_PARTS if chosen & bit)

    def _push(self, frame: bytes) -> None:
        fifo = self._fifo
        room = self.fifo_size - len(fifo)
        if len(frame) > room:
            self._flag(FIFO_OVERFLOW)
            if self._registers[CONFIG] & KEEP_OLD:
                frame = frame[:room]
        fifo += frame
        del fifo[: len(fifo) - self.fifo_size if len(fifo) > self.fifo_size else 0]

    def _flag(self, flag: int) -> None:
        """Set a flag; the older chips have only those which INT_ENABLE asks for."""
        registers = self._registers
        registers[INT_STATUS] |= flag & registers[INT_ENABLE] if self._identity in OLD else flag

    def _get(self, register: int) -> int:
        if register == WHO_AM_I:
            return self._identity
        if register == FIFO_COUNT_H:
            return len(self._fifo) >> 8
        if register == FIFO_COUNT_L:
            return len(self._fifo) & 0xFF
        if register == FIFO_R_W:
            return self._fifo.pop(0) if self._fifo else 0xFF
        if register > 0x7F:
            return 0
        value = self._registers[register]
        if register == INT_STATUS:
            self._registers[INT_STATUS] = 0
        return value

    def _set(self, register: int, value: int) -> None:
        if register not in WRITABLE or (register == ACCEL_CONFIG2 and self._identity in OLD):
            return
        if register == PWR_MGMT_1 and value & RESET:
            self.reset()
            return
        if register == USER_CTRL and value & FIFO_RESET:
            if not (self._identity in OLD and value & FIFO_ON):
                self._fifo.clear()
            value &= ~FIFO_RESET
        if register == CONFIG and self._identity in OLD:
            value &= ~KEEP_OLD
        woken = register == PWR_MGMT_1 and self._registers[register] & ~value & SLEEP
        timing = register in (SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG)
        retimed = timing and self._registers[register] != value
        self._registers[register] = value
        if woken:
            self._woken = self._clock()
        if woken or retimed:
            self._restart()

    def _after(self, register: int) -> int:
        return register if register == FIFO_R_W else register + 1 & 0xFF
