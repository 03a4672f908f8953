"""Wheel counts from a driver that falls silent after a while, beats on, and does so only once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline_msgs import WheelTicks

ENOUGH = 100


@dataclass(frozen=True, slots=True)
class SulkyParams:
    """Samples a second."""

    rate: Annotated[float, "Hz"] = 100.0


class Sulky(Driver[SulkyParams]):
    """Sends a hundred samples and no more, unless a predecessor did so before."""

    wheels = Output(WheelTicks)

    def setup(self) -> None:
        self.count = 0
        self.mark = self.context.run_folder / "sulked"
        self.better = self.mark.exists()

    def tick(self, stamp: int) -> None:
        if self.better or self.count < ENOUGH:
            self.count += 1
            self.wheels.send(WheelTicks(stamp, self.count, self.count))
        else:
            self.mark.touch()


if __name__ == "__main__":
    from lodeline.process import run

    run(Sulky)
