"""The PCF8574 port expander (NXP data sheet): eight pins without a register between them."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.sim.chips.registers import Clock


class Pcf8574Chip:
    """A pin written high is an input with a weak pull-up; one written low stays low."""

    def __init__(self, clock: Clock, pulled_low: Callable[[float], int]) -> None:
        """Take which pins the outside pulls low (bit 0 is P0)."""
        self._clock = clock
        self._pulled_low = pulled_low
        self._latch = 0xFF

    def acknowledges(self) -> bool:
        """Always."""
        return True

    def write(self, data: bytes) -> None:
        """Set the output latch; of several bytes the last one stays."""
        if data:
            self._latch = data[-1]

    def read(self, length: int) -> bytes:
        """Return the pins as they are."""
        return bytes((self._latch & ~self._pulled_low(self._clock()) & 0xFF,)) * length
