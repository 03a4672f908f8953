"""Magnets under the reed bar: which reeds are closed, as lateral offsets of the magnets."""

from __future__ import annotations

from lodeline import magnets
from lodeline.magnets import ReedBarParams
from lodeline.node import Input, Node, Output
from lodeline_msgs import MagnetDetection, ReedBar


class MagnetsNode(Node[ReedBarParams]):
    """`reeds` in, `magnets` out, one for one: that no magnet is there is worth knowing too."""

    reeds = Input(ReedBar, queue=256, max_age=0.5)
    magnets = Output(MagnetDetection)

    def setup(self) -> None:
        self.bar = magnets.ReedBar(self.params)

    @reeds.handler
    def on_reeds(self, reading: ReedBar) -> None:
        self.magnets.send(MagnetDetection(reading.stamp, self.bar.laterals(reading.closed)))


if __name__ == "__main__":
    from lodeline.process import run

    run(MagnetsNode)
