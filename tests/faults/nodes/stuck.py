"""A node whose handler never returns, once: it holds the interpreter, or waits for its own lock."""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass
from typing import Literal

from lodeline.node import Input, Node, Output
from lodeline_msgs import WheelTicks

ENOUGH = 100
FOR_EVER_S = 600


@dataclass(frozen=True, slots=True)
class StuckParams:
    """What it does for ever: `hold` the interpreter, so that no thread runs, or `wait`."""

    ever: Literal["hold", "wait"] = "hold"


class Stuck(Node[StuckParams]):
    """Passes a hundred samples on and no more, unless a predecessor did so before."""

    wheels = Input(WheelTicks, queue=64, max_age=0.5)
    back = Output(WheelTicks)

    def setup(self) -> None:
        self.lock = threading.Lock()
        self.mark = self.context.run_folder / self.context.name
        self.better = self.mark.exists()
        self.count = 0

    @wheels.handler
    def on_wheels(self, sample: WheelTicks) -> None:
        self.count += 1
        if self.count > ENOUGH and not self.better:
            self.mark.touch()
            if self.params.ever == "hold":
                ctypes.PyDLL(None).sleep(FOR_EVER_S)
            with self.lock, self.lock:
                pass
        self.back.send(WheelTicks(sample.stamp, sample.left, sample.right))


if __name__ == "__main__":
    from lodeline.process import run

    run(Stuck)
