"""The motor controller of the simulated Beego: says what it counted, as a real one's program does.

It writes lines of text into a pseudo-terminal, which to the reader is a serial line like any other:
counters.py does not know the difference. Not needed on the robot.
"""

from __future__ import annotations

import contextlib
import os
import tty
from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Input, Node
from lodeline.odometry.kinematics import DifferentialDrive
from lodeline.stamps import Steps, seconds
from lodeline_msgs import Odometry


@dataclass(frozen=True, slots=True)
class MotorsParams:
    """The wheels, and how often a motor's encoder counts while its wheel turns once."""

    wheel_radius: Annotated[float, "m"] = 0.0406
    track: Annotated[float, "m"] = 0.2765
    ticks_per_turn: Annotated[float, "1"] = 2048.0
    gear: Annotated[float, "1"] = 54.0699


class Motors(Node[MotorsParams]):
    """`truth` in, and for each a line: time, counter 1 (left), counter 2 (right)."""

    truth = Input(Odometry, queue=64)

    def setup(self) -> None:
        p = self.params
        self.drive = DifferentialDrive(p.wheel_radius, p.track, p.ticks_per_turn, p.gear)
        self.steps = Steps()
        self.ways = [0.0, 0.0]
        self.told = [0, 0]
        self.line, self.far_end = os.openpty()
        tty.setraw(self.far_end)
        os.set_blocking(self.line, False)
        port = self.context.run_folder / "motors"
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(self.far_end))

    def close(self) -> None:
        os.close(self.line)
        os.close(self.far_end)

    @truth.handler
    def on_truth(self, truth: Odometry) -> None:
        dt = self.steps.take(truth.stamp)
        if dt is None:
            return
        counted = []
        for side, way in enumerate(self.drive.wheels(truth.v * dt, truth.w * dt)):
            self.ways[side] += way / self.drive.metres_per_tick
            counted.append(round(self.ways[side]) - self.told[side])
            self.told[side] += counted[side]
        left, right = counted
        with contextlib.suppress(BlockingIOError):  # nobody reads
            os.write(self.line, f"{seconds(truth.stamp):.3f} {left} {right}\n".encode())


if __name__ == "__main__":
    from lodeline.process import run

    run(Motors)
