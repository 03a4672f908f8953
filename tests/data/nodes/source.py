"""A driver for tests of pipeline files: wheels that turn evenly, faster when commanded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from lodeline.node import Driver, Input, Output
from lodeline_msgs import ReedBar, Twist, WheelTicks


@dataclass(frozen=True, slots=True)
class SourceParams:
    """How often it ticks and how fast its wheels turn."""

    rate: Annotated[float, "Hz"] = 100.0
    speed: Literal["slow", "fast"] = "slow"
    seed: int = 1
    bus: Annotated[int | str, "number of the bus, or sim"] = "sim"
    inverted: bool = False


class Source(Driver[SourceParams]):
    """Counts up by one a tick, by ten if it is fast."""

    cmd_vel = Input(Twist)
    wheels = Output(WheelTicks)
    reeds = Output(ReedBar)

    def setup(self) -> None:
        self.count = 0
        self.step = 10 if self.params.speed == "fast" else 1

    @cmd_vel.handler
    def on_cmd_vel(self, command: Twist) -> None:
        self.step = 10 if command.v > 0.0 else 1

    def tick(self, stamp: int) -> None:
        self.count += self.step
        self.wheels.send(WheelTicks(stamp, self.count, self.count))


if __name__ == "__main__":
    from lodeline.process import run

    run(Source)
