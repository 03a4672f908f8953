"""The MCP23017 port expander (Microchip DS20001952): its port A, with its registers in pairs."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.sim.chips.registers import Clock, RegisterChip

IODIRA, IODIRB, IPOLA, GPPUA, GPIOA, OLATA, LAST = 0x00, 0x01, 0x02, 0x0C, 0x12, 0x14, 0x15
READ_ONLY = (0x0E, 0x0F, 0x10, 0x11)  # interrupt flags and captures


class Mcp23017Chip(RegisterChip):
    """All pins are inputs without a pull-up after power-on; an open one reads as noise does: low.

    The two ports take turns through the registers (IOCON.BANK is 0).
    """

    def __init__(self, clock: Clock, pulled_low: Callable[[float], int]) -> None:
        """Take which pins of port A the outside pulls low (bit 0 is GPA0)."""
        super().__init__(clock)
        self._pulled_low = pulled_low
        self._now = 0.0
        self.reset()

    def reset(self) -> None:
        """Go back to what it is after power-on."""
        self._registers = bytearray(LAST + 1)
        self._registers[IODIRA] = self._registers[IODIRB] = 0xFF

    def _begin(self, now: float) -> None:
        self._now = now

    def _get(self, register: int) -> int:
        registers = self._registers
        if register != GPIOA:
            return registers[register] if register <= LAST else 0
        inputs = registers[IODIRA]
        seen = registers[GPPUA] & ~self._pulled_low(self._now) & 0xFF
        return (inputs & (seen ^ registers[IPOLA])) | (~inputs & 0xFF & registers[OLATA])

    def _set(self, register: int, value: int) -> None:
        if register == GPIOA:
            register = OLATA
        if register <= LAST and register not in READ_ONLY:
            self._registers[register] = value

    def _after(self, register: int) -> int:
        return register + 1 if register < LAST else 0
