"""Claims about what an output counts of itself."""

from __future__ import annotations

from typing import Any, cast

import pytest

from lodeline.status import Outlet
from lodeline_msgs import Odometry, pack


class Reader:
    """A publisher's other end: listens, or does not."""

    key = "rover/odom"

    def __init__(self) -> None:
        self.watched = False
        self.heard: list[bytes] = []

    def put(self, data: bytes) -> None:
        self.heard.append(data)


def test_the_bandwidth_is_that_of_a_listener_from_its_first_second_on() -> None:
    reader = Reader()
    outlet = Outlet(cast("Any", reader))
    sample = Odometry(1, 0.0, 0.0, 0.0, 0.1, 0.0, (0.0,) * 9, (0.0,) * 4, 0)
    for place in range(100):
        reader.watched = place >= 80
        outlet(sample)
    assert len(reader.heard) == 20
    rate, bandwidth = outlet.drain(0.5)
    assert rate == 200.0
    assert bandwidth == pytest.approx(200.0 * len(pack(sample)))
    assert outlet.drain(0.5) == (0.0, 0.0)
