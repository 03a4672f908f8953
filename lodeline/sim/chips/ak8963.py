"""The AK8963 magnetometer (Asahi Kasei MS1356-E) in the package of an MPU-9250.

The field comes in the axes of the gyro; the die is turned: its (x, y, z) are the gyro's (y, x, -z).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from math import floor

from lodeline.sim.chips.registers import Clock, RegisterChip, Sense

WIA, INFO, ST1, HXL, HZH, ST2 = 0x00, 0x01, 0x02, 0x03, 0x08, 0x09
CNTL1, CNTL2, ASTC, I2CDIS, ASAX, ASAZ = 0x0A, 0x0B, 0x0C, 0x0F, 0x10, 0x12
IDENTITY = 0x48
INFORMATION = 0x9A
DATA_READY, DATA_OVERRUN = 0x01, 0x02
OVERFLOW, BITM = 0x08, 0x10
POWER_DOWN, SINGLE, FUSE = 0x0, 0x1, 0xF
RATES = {0x2: 8.0, 0x6: 100.0}  # Hz, of the continuous modes
SINGLE_TIME = 0.0072  # s
SOFT_RESET = 0x01
TESLA_PER_LSB = 0.15e-6
STRONGEST = 4912e-6  # T, the sum of all axes beyond which the sensor overflows
STOP = 32760  # LSB, the end of the scale at 16 bit
_DATA = struct.Struct("<3h")


class Ak8963Chip(RegisterChip):
    """Measures on its own clock, which starts with the mode; holds its data until ST2 is read."""

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
            if now >= self._epoch + SINGLE_TIME:
                self._measure(self._epoch + SINGLE_TIME, 1)
                self._control &= ~0x0F
        elif self._mode in RATES:
            rate = RATES[self._mode]
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
        fine = bool(self._control & BITM)
        unit = TESLA_PER_LSB if fine else 4 * TESLA_PER_LSB
        stop = STOP if fine else STOP // 4
        counts = (
            round(field / (unit * ((asa - 128) / 256.0 + 1.0)))
            for field, asa in zip(die, self._sensitivity, strict=True)
        )
        self._data = _DATA.pack(*(max(-stop, min(stop, count)) for count in counts))
        self._status1 |= DATA_READY
        self._status2 = BITM if fine else 0
        if sum(map(abs, die)) >= STRONGEST:
            self._status2 |= OVERFLOW

    def _get(self, register: int) -> int:
        if register == ST1:
            return self._status1
        if HXL <= register <= HZH:
            self._held = self._mode in RATES
            self._status1 = 0
            return self._data[register - HXL]
        if register == ST2:
            self._held = False
            self._status1 = 0
            return self._status2
        if ASAX <= register <= ASAZ and self._mode == FUSE:
            return self._sensitivity[register - ASAX]
        return {WIA: IDENTITY, INFO: INFORMATION, CNTL1: self._control}.get(register, 0)

    def _set(self, register: int, value: int) -> None:
        if register == CNTL2 and value & SOFT_RESET:
            self.reset()
        elif register == CNTL1:
            mode = value & 0x0F
            if mode != POWER_DOWN and self._mode != POWER_DOWN:
                return  # modes change through power-down only
            self._control = value & 0x1F
            self._held = False
            self._status1 = 0
            self._epoch = self._clock()
            self._measured = 0

    def _after(self, register: int) -> int:
        if register == ASTC:
            return WIA
        return ASAX if register == ASAZ else register + 1
