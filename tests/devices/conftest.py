"""The rigs of the driver tests, closed after each test."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from lodeline.sim.params import RobotParams
from tests.devices.rig import MakeRig, Rig


@pytest.fixture
def rig() -> Iterator[MakeRig]:
    """Make rigs with the given parameters of the robot."""
    rigs: list[Rig] = []

    def make(**params: Any) -> Rig:
        rigs.append(Rig(RobotParams(**({"standing": 0.0} | params))))
        return rigs[-1]

    yield make
    for each in rigs:
        each.bus.close()
