"""The AS5048B magnetic rotary encoder (ams data sheet v1-10): an angle of 14 bits."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.sim.chips.registers import Clock, RegisterChip

AGC, DIAGNOSTICS, MAGNITUDE_HIGH, MAGNITUDE_LOW = 0xFA, 0xFB, 0xFC, 0xFD
ANGLE_HIGH, ANGLE_LOW = 0xFE, 0xFF
OFFSETS_LOADED = 0x01
TURN = 1 << 14  # LSB


class As5048bChip(RegisterChip):
    """Gives the angle of the moment it is asked; `agc` and `flags` say how its magnet sits."""

    def __init__(
        self,
        clock: Clock,
        turn: Callable[[float], float],
        agc: int = 128,
        flags: int = OFFSETS_LOADED,
        magnitude: int = 4096,
    ) -> None:
        """Take the angle as a fraction of a turn in [0, 1)."""
        super().__init__(clock)
        self._turn = turn
        self._angle = 0
        self.agc = agc
        self.flags = flags
        self.magnitude = magnitude

    def _begin(self, now: float) -> None:
        self._angle = int(self._turn(now) * TURN) % TURN

    def _get(self, register: int) -> int:
        if register == ANGLE_HIGH:
            return self._angle >> 6
        if register == ANGLE_LOW:
            return self._angle & 0x3F
        if register == MAGNITUDE_HIGH:
            return self.magnitude >> 6
        if register == MAGNITUDE_LOW:
            return self.magnitude & 0x3F
        return {AGC: self.agc, DIAGNOSTICS: self.flags}.get(register, 0)

    def _set(self, register: int, value: int) -> None:
        pass  # nothing that a driver of a wheel needs is writable
