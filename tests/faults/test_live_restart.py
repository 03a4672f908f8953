"""Claims about kill -9 of a live attitude: back soon, without a swing, with all that it missed."""

from __future__ import annotations

import math
import os
import re
import signal
import time
from collections.abc import Iterator

import pytest

from lodeline.rotation import to_euler, wrap_angle
from lodeline.sessions import Client
from lodeline_msgs import AttitudeEstimate, Odometry, unpack
from tests.supervisor.talk import patience
from tests.support.live import ROOT, Up, eventually

BACK_S = 0.5
SWING = math.radians(1.0)


class Headings:
    """How far the heading of the attitude is from the truth, sample by sample."""

    def __init__(self, client: Client) -> None:
        self.attitudes: list[AttitudeEstimate] = []
        self.truths: list[Odometry] = []
        client.subscribe("rover/attitude", 4096, self._attitude)
        client.subscribe("rover/truth", 4096, self._truth)

    def _attitude(self, _key: str, data: bytes, _encoding: str) -> None:
        self.attitudes.append(unpack(data, AttitudeEstimate))

    def _truth(self, _key: str, data: bytes, _encoding: str) -> None:
        self.truths.append(unpack(data, Odometry))

    def errors(self, begin: int, end: int) -> list[float]:
        found, truths, place = [], list(self.truths), 0
        for estimate in self.attitudes[begin:end]:
            while place + 2 < len(truths) and truths[place + 1].stamp < estimate.stamp:
                place += 1
            a, b = truths[place], truths[place + 1]
            if a.stamp <= estimate.stamp <= b.stamp:
                part = (estimate.stamp - a.stamp) / (b.stamp - a.stamp)
                true = a.yaw + part * wrap_angle(b.yaw - a.yaw)
                found.append(wrap_angle(to_euler(estimate.orientation)[2] - true))
        return found


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


def kill(up: Up, heard: Headings) -> tuple[float, float]:
    """Kill the attitude; until it is back [s], and how far its heading swings then [rad]."""
    caught_up = times_caught_up(up)
    pid = up.ps()["attitude"]["pid"]
    began = time.monotonic()
    os.kill(pid, signal.SIGKILL)
    assert eventually(lambda: times_caught_up(up) > caught_up, 30.0)
    back = len(heard.attitudes)
    assert eventually(lambda: len(heard.attitudes) > back, 10.0)
    seconds = time.monotonic() - began
    assert eventually(lambda: len(heard.attitudes) > back + 300, 30.0)
    assert eventually(lambda: heard.truths[-1].stamp > heard.attitudes[back + 299].stamp)
    before = heard.errors(back - 120, back - 20)
    after = heard.errors(back, back + 300)
    assert len(before) > 50
    assert len(after) > 250
    usual = sum(before) / len(before)
    return seconds, max(abs(error - usual) for error in after)


def times_caught_up(up: Up) -> int:
    """How often the attitude was given samples that it had missed."""
    said = [re.search(r" attitude +\| CAUGHT_UP with (\d+)", line) for line in list(up.log)]
    return sum(int(match[1]) > 0 for match in said if match)


def test_a_killed_attitude_is_back_soon_and_does_not_swing(up: Up) -> None:
    client = Client(up.folder)
    try:
        heard = Headings(client)
        assert eventually(lambda: len(heard.attitudes) > 1500, 60.0)  # it has found north
        for _ in range(2):
            seconds, swing = kill(up, heard)
            print(f"back after {seconds:.2f} s, swing {math.degrees(swing):.2f} deg")
            assert seconds < BACK_S * patience()
            assert swing < SWING
    finally:
        client.close()
