"""A filter for tests of pipeline files: wheels to a speed command, with parameters of all kinds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.node import Input, Node, Output
from lodeline_msgs import Twist, WheelTicks


@dataclass(frozen=True, slots=True)
class Limits:
    """A range, low to high."""

    low: Annotated[float, "m/s"] = 0.0
    high: Annotated[float, "m/s"] = 1.0

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError("the limits are the wrong way round")


@dataclass(frozen=True, slots=True)
class SmootherParams:
    """Length of the window, weights of its thirds, limits of the speed."""

    window: Annotated[float, "s"] = 0.1
    weights: Annotated[tuple[float, float, float], "1"] = (0.25, 0.5, 0.25)
    taps: tuple[int, ...] = ()
    label: str | None = None
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if self.window <= 0.0:
            raise ValueError(f"window must be positive, got {self.window:g}")


class Smoother(Node[SmootherParams]):
    """Sends the mean of the last counts as a speed; what comes back to it counts as one more."""

    wheels = Input(WheelTicks, queue=8, max_age=0.5)
    back = Input(Twist)
    speed = Output(Twist)

    def setup(self) -> None:
        self.counts: list[float] = []

    @wheels.handler
    def on_wheels(self, sample: WheelTicks) -> None:
        self.counts = [*self.counts, float(sample.left)][-3:]
        self.speed.send(Twist(sample.stamp, sum(self.counts) / len(self.counts), 0.0))

    @back.handler
    def on_back(self, sample: Twist) -> None:
        self.counts = [*self.counts, sample.v][-3:]


if __name__ == "__main__":
    from lodeline.process import run

    run(Smoother)
