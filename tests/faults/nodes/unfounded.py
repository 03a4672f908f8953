"""A node whose library is there when the pipeline is checked, and gone when it is started."""

from __future__ import annotations

import os

if "LODELINE_LAUNCH" in os.environ:
    import a_library_that_nobody_has  # type: ignore[import-not-found]  # noqa: F401

from dataclasses import dataclass

from lodeline.node import Input, Node
from lodeline_msgs import WheelTicks


@dataclass(frozen=True, slots=True)
class UnfoundedParams:
    """None."""


class Unfounded(Node[UnfoundedParams]):
    """Never gets as far as this."""

    wheels = Input(WheelTicks)

    @wheels.handler
    def on_wheels(self, sample: WheelTicks) -> None:
        raise AssertionError("it cannot have been imported")


if __name__ == "__main__":
    from lodeline.process import run

    run(Unfounded)
