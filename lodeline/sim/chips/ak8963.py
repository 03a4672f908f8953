"""The AK8963 magnetometer (Asahi Kasei MS1356-E) in the package of an MPU-9250, and the AK8975
(MS1187-E) in that of an MPU-9150.

The field comes in the axes of the gyro; the die is turned: its (x, y, z) are the gyro's (y, x, -z).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from math import floor

from lodeline.sim.chips.registers import Clock, RegisterChip, Sense

WIA, INFO, ST1, HXL, HZH, ST2 = 0x00, 0x01, 0x02, 0x03, 0x08, 0x09
CNTL1, CNTL2, ASTC, I2CDIS, ASAX, ASAZ = 0x0A, 0x0B, 0x0C, 0x0F, 0x10, 0x12
IDENTITY = 0x48
DATA_READY, DATA_OVERRUN = 0x01, 0x02
OVERFLOW, BITM = 0x08, 0x10
POWER_DOWN, SINGLE, FUSE = 0x0, 0x1, 0xF
SOFT_RESET = 0x01
MODE_TIME = 100e-6  # s in power-down before another mode
FINE = 0.15e-6  # T/LSB at 16 bit
COARSE = 4 * FINE
_DATA = struct.Struct("<3h")


class Ak8963Chip(RegisterChip):
    """Measures on its own clock, which starts with the mode; holds its data until ST2 is read."""

    information = 0x9A
    rates: Mapping[int, float] = {0x2: 8.0, 0x6: 100.0}  # Hz, of the continuous modes
    single_time = 0.0072  # s
    strongest = 4912e-6  # T, the sum of all axes beyond which the sensor overflows

    def __init__(
        self,
        clock: Clock,
        magnetic_field: Sense,
        connected: Callable[[], bool],
        sensitivity: tuple[int, int, int] = (176, 178, 167),
    ) -> None:
        """Take the field [T] and whether the bypass is on; `sensitivity` is its fuse ROM."""
        super().__init__(clock)
        self._magnetic_field = magnetic_field
        self._connected = connected
        self._sensitivity = sensitivity
        self.reset()

    def reset(self) -> None:
        """Go back to what it is after power-on."""
        self._control = POWER_DOWN
        self._down_since = float("-inf")
        self._status1 = 0
        self._status2 = 0
        self._data = bytes(6)
        self._held = False
        self._epoch = 0.0
        self._measured = 0

    def acknowledges(self) -> bool:
        """Answer only while the bypass is on."""
        return self._connected()

    @property
    def _mode(self) -> int:
        return self._control & 0x0F

    def _begin(self, now: float) -> None:
        if self._mode == SINGLE:
            if now >= self._epoch + self.single_time:
                self._measure(self._epoch + self.single_time, 1)
                self._control &= ~0x0F
        elif self._mode in self.rates:
            rate = self.rates[self._mode]
            done = floor((now - self._epoch) * rate + 1e-6)
            if done > self._measured:
                self._measure(self._epoch + done / rate, done - self._measured)
                self._measured = done

    def _measure(self, t: float, count: int) -> None:
        """Take the newest of `count` measurements that ended since the last look."""
        if self._held:  # being read: the data stay what they are
            self._status1 |= DATA_OVERRUN
            return
        if count > 1 or self._status1 & DATA_READY:
            self._status1 |= DATA_OVERRUN
        x, y, z = self._magnetic_field(t)
        die = (y, x, -z)
        unit, stop = self._scale()
        counts = (
            round(field / (unit * ((asa - 128) / 256.0 + 1.0)))
            for field, asa in zip(die, self._sensitivity, strict=True)
        )
        self._data = _DATA.pack(*(max(-stop, min(stop, count)) for count in counts))
        self._status1 |= DATA_READY
        self._status2 = BITM if unit == FINE else 0
        if sum(map(abs, die)) >= self.strongest:
            self._status2 |= OVERFLOW

    def _scale(self) -> tuple[float, int]:
        """Return tesla per LSB, and the LSB at which the scale ends."""
        return (FINE, 32760) if self._control & BITM else (COARSE, 8190)

    def _get(self, register: int) -> int:
        if register == ST1:
            return self._status1
        if HXL <= register <= HZH:
            self._held = self._mode in self.rates
            self._status1 = 0
            return self._data[register - HXL]
        if register == ST2:
            self._held = False
            self._status1 = 0
            return self._status2
        if ASAX <= register <= ASAZ and self._mode == FUSE:
            return self._sensitivity[register - ASAX]
        return {WIA: IDENTITY, INFO: self.information, CNTL1: self._control}.get(register, 0)

    def _set(self, register: int, value: int) -> None:
        if register == CNTL2 and value & SOFT_RESET:
            self.reset()
        elif register == CNTL1:
            mode = value & 0x0F
            if mode != POWER_DOWN and self._mode != POWER_DOWN:
                return  # modes change through power-down only
            if mode == POWER_DOWN and self._mode != POWER_DOWN:
                self._down_since = self._clock()
            elif mode != POWER_DOWN and self._clock() < self._down_since + MODE_TIME:
                return  # too soon: the data sheet does not say what happens then
            self._control = value & 0x1F
            self._held = False
            self._status1 = 0
            self._epoch = self._clock()
            self._measured = 0

    def _after(self, register: int) -> int:
        if register == ASTC:
            return WIA
        return ASAX if register == ASAZ else register + 1


class Ak8975Chip(Ak8963Chip):
    """The older one: 13 bit, and no continuous modes; each measurement is asked for by itself."""

    information = 0x00
    rates: Mapping[int, float] = {}
    single_time = 0.0073
    strongest = 2400e-6

    def _scale(self) -> tuple[float, int]:
        return 0.3e-6, 4095

    def _set(self, register: int, value: int) -> None:
        if register != CNTL2:  # there is no soft reset
            super()._set(register, value)
