"""Sends the reading of an IMU at rest, `rate` times a second, and remembers when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.bench.chain.ends import Sent
from lodeline.node import Driver, Output
from lodeline_msgs import Imu


@dataclass(frozen=True, slots=True)
class SourceParams:
    """How often, and where to write the stamps at the end."""

    rate: Annotated[float, "Hz"]
    folder: Annotated[str, "path"]


class Source(Driver[SourceParams]):
    """The head of the chain."""

    data_raw = Output(Imu)

    def setup(self) -> None:
        self.sent = Sent(self.params.folder)

    def tick(self, stamp: int) -> None:
        self.data_raw.send(Imu(stamp, (0.0, 0.0, 0.1), (0.0, 0.0, 9.81)))
        self.sent.add(stamp)

    def close(self) -> None:
        self.sent.write()


if __name__ == "__main__":
    from lodeline.process import run

    run(Source)
