"""A driver that misbehaves when it is told to, and a pipeline of one for each way to do so."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from lodeline.node import Driver, Input, Output
from lodeline_msgs import Twist, WheelTicks

LEAK_BYTES = 200_000
LINES = 50
TALK_TICKS = 200

PIPELINE = f"""
name: unruly
external: {{begin_silent: Twist, begin_leak: Twist, begin_talk: Twist}}
nodes:
  silent:
    run: {Path(__file__)}
    inputs: {{begin: begin_silent}}
    outputs: {{wheels: silent}}
    params: {{fault: silent}}
    rate: {{wheels: 100}}
    restart_on_silence: true
  leak:
    run: {Path(__file__)}
    inputs: {{begin: begin_leak}}
    outputs: {{wheels: leak}}
    params: {{fault: leak}}
    rate: {{wheels: 100}}
    rss_mb: 120
  talk:
    run: {Path(__file__)}
    inputs: {{begin: begin_talk}}
    outputs: {{wheels: talk}}
    params: {{fault: talk}}
    rate: {{wheels: 100}}
"""


@dataclass(frozen=True, slots=True)
class UnrulyParams:
    """Send no more, take 20 MB more each second, or write 5000 lines a second for two."""

    fault: Literal["silent", "leak", "talk"]
    rate: Annotated[float, "Hz"] = 100.0


class Unruly(Driver[UnrulyParams]):
    """Sends a count at each tick; from the first sample on `begin` it has its fault."""

    begin = Input(Twist, queue=8)
    wheels = Output(WheelTicks)

    def setup(self) -> None:
        self.count = 0
        self.ill = 0
        self.hoard: list[bytes] = []

    @begin.handler
    def on_begin(self, _sample: Twist) -> None:
        self.ill = 1

    def tick(self, stamp: int) -> None:
        self.count += 1
        if self.ill:
            self.ill += 1
            if self.params.fault == "silent":
                return
            if self.params.fault == "leak":
                self.hoard.append(b"x" * LEAK_BYTES)
            elif self.ill < TALK_TICKS:
                print("\n".join(f"line {i} of {self.count}" for i in range(LINES)), flush=True)
        self.wheels.send(WheelTicks(stamp, self.count, self.count))


if __name__ == "__main__":
    from lodeline.process import run

    run(Unruly)
