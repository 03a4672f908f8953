"""A source of wheel counts: even, or silent after some samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline_msgs import WheelTicks


@dataclass(frozen=True, slots=True)
class WheelsParams:
    """`most` samples are sent, all if it is None."""

    rate: Annotated[float, "Hz"] = 100.0
    most: int | None = None


class Wheels(Driver[WheelsParams]):
    """Counts one up at each tick, on both sides."""

    wheels = Output(WheelTicks)

    def setup(self) -> None:
        self.count = 0

    def tick(self, stamp: int) -> None:
        self.count += 1
        if self.params.most is None or self.count <= self.params.most:
            self.wheels.send(WheelTicks(stamp, self.count, self.count))


if __name__ == "__main__":
    from lodeline.process import run

    run(Wheels)
