"""Hears four stages of a pipeline from their first sample on: number and time of each sample."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from lodeline.node import Input, Node
from lodeline_msgs import Imu, Odometry, PoseEstimate, WheelTicks


@dataclass(frozen=True, slots=True)
class EarParams:
    """Where to write at the end what was heard."""

    file: Annotated[str, "path"]


class Ear(Node[EarParams]):
    """For each port [number, monotonic ns on arrival] of every sample."""

    data = Input(Imu, queue=256)
    wheels = Input(WheelTicks, queue=256)
    odom = Input(Odometry, queue=256)
    pose = Input(PoseEstimate, queue=256)

    def setup(self) -> None:
        self.heard: dict[str, list[tuple[int, int]]] = {name: [] for name in self.inputs()}

    def note(self, port: str, message: Any) -> None:
        self.heard[port].append((message.seq, time.monotonic_ns()))

    @data.handler
    def on_data(self, data: Imu) -> None:
        self.note("data", data)

    @wheels.handler
    def on_wheels(self, wheels: WheelTicks) -> None:
        self.note("wheels", wheels)

    @odom.handler
    def on_odom(self, odom: Odometry) -> None:
        self.note("odom", odom)

    @pose.handler
    def on_pose(self, pose: PoseEstimate) -> None:
        self.note("pose", pose)

    def close(self) -> None:
        Path(self.params.file).write_text(json.dumps(self.heard))


if __name__ == "__main__":
    from lodeline.process import run

    run(Ear)
