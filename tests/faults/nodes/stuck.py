"""A node whose handler holds the interpreter for ever, once: none of its threads runs any more."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from lodeline.node import Input, Node, Output
from lodeline_msgs import WheelTicks

ENOUGH = 100
FOR_EVER_S = 600


@dataclass(frozen=True, slots=True)
class StuckParams:
    """It has none."""


class Stuck(Node[StuckParams]):
    """Passes a hundred samples on and no more, unless a predecessor did so before."""

    wheels = Input(WheelTicks, queue=64, max_age=0.5)
    back = Output(WheelTicks)

    def setup(self) -> None:
        self.mark = self.context.run_folder / "stuck"
        self.better = self.mark.exists()
        self.count = 0

    @wheels.handler
    def on_wheels(self, sample: WheelTicks) -> None:
        self.count += 1
        if self.count > ENOUGH and not self.better:
            self.mark.touch()
            ctypes.PyDLL(None).sleep(FOR_EVER_S)
        self.back.send(WheelTicks(sample.stamp, sample.left, sample.right))


if __name__ == "__main__":
    from lodeline.process import run

    run(Stuck)
