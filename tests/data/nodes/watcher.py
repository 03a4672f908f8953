"""A sink for tests of pipeline files: keeps what it is sent; it cannot do without `limit`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Input, Node
from lodeline_msgs import Twist


@dataclass(frozen=True, slots=True)
class WatcherParams:
    """How many samples it keeps."""

    limit: Annotated[int, "1"]


class Watcher(Node[WatcherParams]):
    """Keeps the newest speeds."""

    speed = Input(Twist)

    def setup(self) -> None:
        self.kept: list[float] = []

    @speed.handler
    def on_speed(self, sample: Twist) -> None:
        self.kept = [*self.kept, sample.v][-self.params.limit :]


if __name__ == "__main__":
    from lodeline.process import run

    run(Watcher)
