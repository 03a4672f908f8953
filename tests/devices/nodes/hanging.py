"""A simulator whose bus hangs for some seconds, as when a chip holds SDA low."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline.sim.adapter import Message
from lodeline.sim.params import RobotParams
from lodeline.sim.robot import SimulatedRobot
from lodeline.sim.server import I2cServer
from lodeline_msgs import Twist

LONG = 30.0  # s


@dataclass(frozen=True, slots=True)
class HangingParams:
    """Which file makes it hang while it is there."""

    rate: Annotated[float, "Hz"] = 10.0
    hang_file: str = ""


class Hanging(Driver[HangingParams]):
    """Beats, whatever its bus does."""

    beat = Output(Twist)

    def setup(self) -> None:
        self.robot = SimulatedRobot(RobotParams(standing=0.0), self.context.monotonic)
        self.server = I2cServer(self, self.context.sim_socket)

    def close(self) -> None:
        self.server.close()

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        begin = time.monotonic()
        while Path(self.params.hang_file).exists() and time.monotonic() - begin < LONG:
            time.sleep(0.005)
        return self.robot.bus.transfer(messages)

    def tick(self, stamp: int) -> None:
        self.beat.send(Twist(stamp, 0.0, 0.0))


if __name__ == "__main__":
    from lodeline.process import run

    run(Hanging)
