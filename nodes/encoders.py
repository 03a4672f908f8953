"""Driver of two AS5048B magnetic encoders, one at each wheel."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.devices import STATES, Encoders, EncodersParams, EncodersState
from lodeline.i2c import open_bus
from lodeline.node import Driver, Output
from lodeline.stamps import seconds
from lodeline_msgs import WheelTicks


@dataclass(frozen=True, slots=True)
class EncodersNodeParams:
    """Which bus, how often, and where the encoders are."""

    bus: Annotated[int | str, "number of the I2C bus, or sim"] = "sim"
    rate: Annotated[float, "Hz"] = 100.0
    encoders: EncodersParams = field(default_factory=EncodersParams)


class EncodersDriver(Driver[EncodersNodeParams]):
    """Sends cumulative counts; a read that failed is left out, the way is not."""

    State = EncodersState
    wheels = Output(WheelTicks)

    def setup(self) -> None:
        bus = open_bus(self.params.bus, self.context.sim_socket, self.context.sim_timeout)
        self.encoders = Encoders(bus, self.params.encoders)

    def save(self) -> EncodersState | None:
        return self.encoders.state

    def resume(self, state: EncodersState) -> None:
        self.encoders.resume(state)

    def tick(self, stamp: int) -> None:
        counts = self.encoders.read(seconds(stamp))
        if counts is not None:
            self.wheels.send(WheelTicks(stamp, *counts))
        health = self.encoders.health
        self.context.report(STATES[health.state], health.message)


if __name__ == "__main__":
    from lodeline.process import run

    run(EncodersDriver)
