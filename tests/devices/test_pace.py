"""A driver that ticks unevenly says so, and reads the chip all the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from lodeline.devices import Pace
from lodeline.i2c import open_model
from lodeline.loading import load_node
from lodeline.node import Context, Driver
from lodeline.sim.params import RobotParams
from lodeline.sim.robot import SimulatedRobot

NODES = Path(__file__).parents[2] / "nodes"


def test_even_ticks_are_not_late_and_one_late_tick_counts_once() -> None:
    pace = Pace(200.0)
    assert not any(pace.late(0.005 * i) for i in range(1000))
    assert pace.late(5.0006), "0.6 ms after 5 ms were over"
    assert not any(pace.late(0.005 * i) for i in range(1001, 2000))


@pytest.mark.parametrize("name", ["imu", "encoders", "magnet_bar"])
def test_every_driver_publishes_how_many_of_its_ticks_were_late(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    robot = SimulatedRobot(RobotParams(), lambda: now)
    kind = load_node(NODES / f"{name}.py")
    monkeypatch.setitem(kind.setup.__globals__, "open_bus", lambda *_: open_model(robot.bus))
    node = kind(kind.params_type()(), Context(monotonic=lambda: now))
    assert isinstance(node, Driver)
    period = 1.0 / node.params.rate
    for i in range(500):
        now = i * period + (0.2 * period if i in (100, 200) else 0.0)
        node.tick(round(now * 1e9))
    assert node.context.rejected == {"late tick": 2}
    assert node.context.state == "running"
