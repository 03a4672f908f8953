"""The subscriber at the end: how old each pose is when its handler has it."""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass
from typing import Annotated

from lodeline.bench.chain.ends import Heard
from lodeline.launch import VARIABLE
from lodeline.node import Input, Node
from lodeline_msgs import PoseEstimate


@dataclass(frozen=True, slots=True)
class SinkParams:
    """Where to write what came, at the end."""

    folder: Annotated[str, "path"]


class Sink(Node[SinkParams]):
    """The tail of the chain."""

    pose = Input(PoseEstimate, queue=256)

    def setup(self) -> None:
        self.heard = Heard(self.params.folder)
        launch = os.environ.get(VARIABLE)
        self.offset = json.loads(launch)["epoch_offset"] if launch else 0

    @pose.handler
    def on_pose(self, pose: PoseEstimate) -> None:
        self.heard.add(pose.stamp, time.monotonic_ns() + self.offset)

    def close(self) -> None:
        self.heard.write()


if __name__ == "__main__":
    from lodeline.process import run

    run(Sink)
