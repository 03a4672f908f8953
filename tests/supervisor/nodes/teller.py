"""A sink: tells the number of each sample it gets."""

from __future__ import annotations

from dataclasses import dataclass

from lodeline.node import Input, Node
from lodeline_msgs import WheelTicks


@dataclass(frozen=True, slots=True)
class TellerParams:
    word: str = "got"


class Teller(Node[TellerParams]):
    wheels = Input(WheelTicks, queue=64)

    @wheels.handler
    def on_wheels(self, ticks: WheelTicks) -> None:
        print(f"{self.params.word} {ticks.seq}", flush=True)


if __name__ == "__main__":
    from lodeline.process import run

    run(Teller)
