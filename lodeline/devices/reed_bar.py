"""A bar of eight reed switches on a PCF8574 port expander."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.devices.link import Health, Link
from lodeline.i2c import Bus

ALL_INPUTS = 0xFF  # a pin is an input once it is written high


@dataclass(frozen=True, slots=True)
class ReedBarParams:
    """Where the expander is. Inverted: a closed reed pulls its pin high instead of low."""

    address: Annotated[int, "1"] = 0x20
    inverted: Annotated[bool, "1"] = False


class ReedBar:
    """The driver."""

    def __init__(self, bus: Bus, params: ReedBarParams | None = None, name: str = "bar") -> None:
        p = params if params is not None else ReedBarParams()
        self._bus = bus
        self._address = p.address
        self._flip = 0x00 if p.inverted else 0xFF
        self._link = Link(name, bus, p.address, (self._configure,))

    @property
    def health(self) -> Health:
        """How the expander does."""
        return self._link.health

    def read(self, now_s: float) -> int | None:
        """Return the closed reeds (bit 0 is reed 1, 1 = closed), None if the read failed."""
        if not self._link.ready(now_s):
            return None
        pins = self._link.attempt(now_s, self._pins)
        return None if pins is None else pins ^ self._flip

    def _configure(self) -> float:
        self._bus.write_byte(self._address, ALL_INPUTS)
        return 0.0

    def _pins(self) -> int:
        return self._bus.read_byte(self._address)
