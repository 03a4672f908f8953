"""Passes wheel counts on and takes commands; trips over samples, or takes its time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Input, Node, Output
from lodeline_msgs import Twist, WheelTicks


@dataclass(frozen=True, slots=True)
class RelayParams:
    """Every `trips` samples its handler raises, never if it is 0; it takes `pause` for each."""

    trips: int = 0
    pause: Annotated[float, "s"] = 0.0


class Relay(Node[RelayParams]):
    """`back` says what came on `wheels`, with the speed commanded last as its count."""

    wheels = Input(WheelTicks, queue=64, max_age=0.5)
    command = Input(Twist, queue=64, max_age=0.5)
    back = Output(WheelTicks)

    def setup(self) -> None:
        self.speed = 0

    @wheels.handler
    def on_wheels(self, sample: WheelTicks) -> None:
        if self.params.trips and sample.left % self.params.trips == 0:
            raise ValueError(f"tripped over {sample.left}")
        if self.params.pause:
            time.sleep(self.params.pause)
        self.back.send(WheelTicks(sample.stamp, sample.left, self.speed))

    @command.handler
    def on_command(self, sample: Twist) -> None:
        self.speed = int(sample.v)


if __name__ == "__main__":
    from lodeline.process import run

    run(Relay)
