"""A bar of eight reed switches on a port expander: PCF8574 (0x20, PCF8574A 0x38) or MCP23017."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from lodeline.devices.link import Health, Link
from lodeline.i2c import Bus

ALL_INPUTS = 0xFF  # a pin of a PCF8574 is an input once it is written high
IODIRA, IPOLA, GPPUA = 0x00, 0x02, 0x0C  # of an MCP23017; GPIOA is six behind GPPUA
STUCK_AFTER = 3  # times that other reeds closed anew: magnets are that far behind by now
REEDS = 8


@dataclass(frozen=True, slots=True)
class ReedBarParams:
    """Which expander, and where. Inverted: a closed reed pulls its pin high instead of low."""

    chip: Literal["pcf8574", "mcp23017"] = "pcf8574"
    address: Annotated[int, "1"] = 0x20
    inverted: Annotated[bool, "1"] = False


class ReedBar:
    """The driver. A reed that stays closed while magnets go by under others is masked.

    The pins of an MCP23017 float after a reset, which its pull-up register, read with them, tells.
    A PCF8574 has no settings that it could lose.
    """

    def __init__(self, bus: Bus, params: ReedBarParams | None = None, name: str = "bar") -> None:
        self._params = p = params if params is not None else ReedBarParams()
        self._bus = bus
        self._name = name
        self._flip = 0x00 if p.inverted else 0xFF
        self._link = Link(name, bus, p.address, (self._configure,))
        self._stuck = StuckReeds()

    @property
    def health(self) -> Health:
        """How the expander does."""
        return self._link.health

    def read(self, now_s: float) -> int | None:
        """Return the closed reeds (bit 0 is reed 1, 1 = closed), None if the read failed."""
        link = self._link
        if not link.ready(now_s):
            return None
        pins = link.attempt(now_s, self._pins)
        if pins is None:
            return None
        if pins < 0:
            link.lost(now_s, f"BAR_RESET {self._name}: registers lost, reconfigured")
            link.ready(now_s)
            return None
        closed = pins ^ self._flip
        self._tell(self._stuck.update(closed))
        return closed & ~self._stuck.mask

    def _tell(self, changed: int) -> None:
        health, mask = self._link.health, self._stuck.mask
        if changed & mask:
            reeds = ", ".join(str(reed + 1) for reed in range(REEDS) if mask >> reed & 1)
            health.tell(f"REED_STUCK {self._name}: {reeds} masked, does not open - check the reed")
            health.state = "degraded"
        elif changed and not mask:
            health.tell(f"REED_FREE {self._name}: all reeds open again")
            health.state = "ok"

    def _configure(self) -> float:
        bus, address = self._bus, self._params.address
        if self._params.chip == "mcp23017":
            bus.write_byte_data(address, IODIRA, 0xFF)
            bus.write_byte_data(address, IPOLA, 0x00)
            bus.write_byte_data(address, GPPUA, 0xFF)
        else:
            bus.write_byte(address, ALL_INPUTS)
        return 0.0

    def _pins(self) -> int:
        """Return the pins, -1 if they float."""
        if self._params.chip != "mcp23017":
            return self._bus.read_byte(self._params.address)
        pull_ups, *_, pins = self._bus.read_i2c_block_data(self._params.address, GPPUA, 7)
        return pins if pull_ups == 0xFF else -1


class StuckReeds:
    """Finds reeds that stay closed while others, not beside them, close time and again.

    One magnet closes a reed or two neighbours, and not for longer than the robot takes to leave
    it; by the time that another reed has closed three times, three magnets went by.
    """

    def __init__(self) -> None:
        self.mask = 0
        self._before = 0
        self._seen = [0] * REEDS  # for each reed: magnets elsewhere since it closed

    def update(self, closed: int) -> int:
        """Take the closed reeds; return those that are masked, or no longer masked, from now on."""
        anew = closed & ~self._before & ~self.mask
        self._before = closed
        mask = self.mask & closed
        for reed in range(REEDS):
            bit = 1 << reed
            beside = bit | bit << 1 | bit >> 1
            if not closed & bit:
                self._seen[reed] = 0
            elif anew & ~beside:
                self._seen[reed] += 1
            if self._seen[reed] >= STUCK_AFTER:
                mask |= bit
        changed, self.mask = mask ^ self.mask, mask
        return changed
