"""A source: wheels that turn one count at each tick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline_msgs import WheelTicks


@dataclass(frozen=True, slots=True)
class TicksParams:
    rate: Annotated[float, "Hz"] = 50.0


class Ticks(Driver[TicksParams]):
    wheels = Output(WheelTicks)

    def setup(self) -> None:
        self.count = 0

    def tick(self, stamp: int) -> None:
        self.count += 1
        self.wheels.send(WheelTicks(stamp=stamp, left=self.count, right=self.count))


if __name__ == "__main__":
    from lodeline.process import run

    run(Ticks)
