"""Driver of a bar of eight reed switches on a PCF8574 port expander."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.devices import STATES, ReedBarParams
from lodeline.devices import ReedBar as Bar
from lodeline.i2c import open_bus
from lodeline.node import Driver, Output
from lodeline.stamps import seconds
from lodeline_msgs import ReedBar


@dataclass(frozen=True, slots=True)
class MagnetBarParams:
    """Which bus, how often, and where the expander is."""

    bus: Annotated[int | str, "number of the I2C bus, or sim"] = "sim"
    rate: Annotated[float, "Hz"] = 100.0
    bar: ReedBarParams = field(default_factory=ReedBarParams)


class MagnetBarDriver(Driver[MagnetBarParams]):
    """Sends which reeds are closed, magnet or not: silence would look like a dead bar."""

    reeds = Output(ReedBar)

    def setup(self) -> None:
        bus = open_bus(self.params.bus, self.context.sim_socket, self.context.sim_timeout)
        self.bar = Bar(bus, self.params.bar)

    def tick(self, stamp: int) -> None:
        closed = self.bar.read(seconds(stamp))
        if closed is not None:
            self.reeds.send(ReedBar(stamp, closed))
        health = self.bar.health
        self.context.report(STATES[health.state], health.message)


if __name__ == "__main__":
    from lodeline.process import run

    run(MagnetBarDriver)
