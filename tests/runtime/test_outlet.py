"""Claims about what an output counts of itself."""

from __future__ import annotations

from typing import Any, cast

import msgpack
import pytest

from lodeline.recent import Recent
from lodeline.status import Outlet
from lodeline_msgs import Odometry, pack, unpack


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
    outlet = Outlet(cast("Any", reader), Recent("me"))
    sample = Odometry(1, 0.0, 0.0, 0.0, 0.1, 0.0, (0.0,) * 9, (0.0,) * 4, 0)
    for place in range(100):
        reader.watched = place >= 80
        outlet(sample)
    assert len(reader.heard) == 20
    rate, bandwidth = outlet.drain(0.5)
    assert rate == 200.0
    assert bandwidth == pytest.approx(200.0 * len(pack(sample)))
    assert outlet.drain(0.5) == (0.0, 0.0)


def test_what_is_sent_is_kept_while_somebody_listens_and_twenty_seconds_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    reader, recent = Reader(), Recent("me")
    outlet = Outlet(cast("Any", reader), recent)
    for seq in range(100):
        now = float(seq)
        reader.watched = 10 <= seq < 20
        outlet(Odometry(seq, 0.0, 0.0, 0.0, 0.1, 0.0, (0.0,) * 9, (0.0,) * 4, 0, seq=seq))
    _, kept = msgpack.unpackb(recent.answer())
    assert [unpack(data, Odometry).seq for data in kept] == list(range(10, 39))
    assert len(reader.heard) == 10
