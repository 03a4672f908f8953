"""Claims about ticks: on time, drift-free, never silently stuck."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest

from lodeline.clock import HostClock
from lodeline.launch import Launch
from lodeline.node import Driver, Node
from lodeline.sessions import Hub
from lodeline.stamps import Steps
from lodeline.status import StatusReporter
from lodeline.ticker import Ticker
from lodeline_msgs import NodeStatus, unpack


@dataclass(frozen=True, slots=True)
class Params:
    rate: Annotated[float, "Hz"] = 100.0


class Counting(Driver[Params]):
    """Notes its ticks, and does in each what the test wants."""

    def setup(self) -> None:
        self.stamps: list[int] = []
        self.enough = threading.Event()
        self.wanted = 50
        self.do: Callable[[], object] = dict

    def tick(self, stamp: int) -> None:
        self.stamps.append(stamp)
        if len(self.stamps) >= self.wanted:
            self.enough.set()
        self.do()


class Failures:
    """What the ticker told of exceptions."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, int]] = []

    def __call__(self, node: Node[Params], error: BaseException, in_a_row: int) -> None:
        self.seen.append((str(error), in_a_row))


def started(driver: Counting, failures: Failures | None = None) -> Ticker:
    ticker = Ticker(driver, HostClock(0), threading.RLock(), failures or Failures())
    ticker.start()
    return ticker


def test_ticks_keep_their_rate_without_drift() -> None:
    driver = Counting(Params(rate=200.0))
    driver.wanted = 200
    ticker = started(driver)
    assert driver.enough.wait(10.0)
    ticker.stop()
    ticks = len(driver.stamps) - 1 + driver.context.rejected["missed tick"]
    elapsed = (driver.stamps[-1] - driver.stamps[0]) * 1e-9
    assert ticks / 200.0 == pytest.approx(elapsed, abs=0.02)


def test_a_slow_tick_is_followed_by_counted_misses_not_by_a_burst() -> None:
    driver = Counting(Params(rate=100.0))
    driver.wanted = 20
    pauses = iter([0.0] * 5 + [0.2])
    driver.do = lambda: time.sleep(next(pauses, 0.0))
    ticker = started(driver)
    assert driver.enough.wait(10.0)
    ticker.stop()
    assert driver.context.rejected["missed tick"] >= 15
    gaps = [(b - a) * 1e-9 for a, b in zip(driver.stamps, driver.stamps[1:], strict=False)]
    # One short gap follows each tick that came late; a burst would make up for all twenty missed.
    assert sum(gap < 0.002 for gap in gaps) < 7, "a burst of late ticks"


def test_ticks_that_begin_late_are_counted_and_how_late_they_were_is_known() -> None:
    driver = Counting(Params(rate=10.0))
    driver.wanted = 7
    pauses = iter([0.0, 0.14, 0.0, 0.0, 0.14])
    driver.do = lambda: time.sleep(next(pauses, 0.0))
    ticker = started(driver)
    assert driver.enough.wait(10.0)
    ticker.stop()
    late = sorted(driver.context.lateness)
    assert driver.context.rejected["late tick"] >= 2
    assert sum(each > 0.035 for each in late) >= 2, "40 ms after two ticks of 140 ms"
    assert late[0] < 0.02


def test_an_exception_in_a_tick_is_counted_and_the_next_tick_comes() -> None:
    driver = Counting(Params(rate=200.0))
    driver.wanted = 10

    def fail() -> None:
        if len(driver.stamps) in (3, 4, 6):
            raise ValueError("no reading")

    driver.do = fail
    failures = Failures()
    ticker = started(driver, failures)
    assert driver.enough.wait(10.0)
    ticker.stop()
    assert failures.seen[:3] == [("no reading", 1), ("no reading", 2), ("no reading", 1)]
    assert driver.context.rejected["exception"] == 3
    assert driver.context.last_error == "ValueError: no reading"


def test_a_driver_that_skips_more_than_a_twentieth_of_its_ticks_is_degraded(
    short_folder: Path,
) -> None:
    driver = Counting(Params(rate=100.0))
    driver.wanted = 20
    pauses = iter([0.0] * 5 + [0.2])
    driver.do = lambda: time.sleep(next(pauses, 0.0))
    hub = Hub(short_folder)
    launch = Launch("rover", "0123", "robot", "wheels", str(short_folder), 0, "host", 0, 0, ())
    said: queue.Queue[NodeStatus] = queue.Queue()
    hub.subscribe("rover/status/*", 8, lambda _key, data, _: said.put(unpack(data, NodeStatus)))
    reporter = StatusReporter(launch, {"wheels": driver}, hub)
    ticker = started(driver)
    assert driver.enough.wait(10.0)
    ticker.stop()
    reporter.send(1)
    reporter.send(2)  # no tick was skipped since
    first, second = said.get(timeout=5.0), said.get(timeout=5.0)
    hub.close()
    missed = first.rejected["missed tick"]
    assert missed > 5
    assert first.state == "degraded"
    assert first.last_error.startswith(f"MISSED_TICKS wheels: {missed} of 100 in the last second")
    assert (second.state, second.last_error) == ("running", "")


def test_a_tick_that_hangs_shows() -> None:
    driver = Counting(Params(rate=200.0))
    driver.wanted = 1
    go_on = threading.Event()
    driver.do = lambda: go_on.wait(10.0)
    ticker = started(driver)
    assert driver.enough.wait(10.0)
    assert ticker.alive()
    deadline = time.monotonic() + 5.0
    while ticker.alive() and time.monotonic() < deadline:
        go_on.wait(0.02)
    assert not ticker.alive()
    go_on.set()
    ticker.stop()


def test_steps_leave_out_what_is_not_newer_and_tell_the_length_of_a_hole() -> None:
    steps = Steps()
    second = 1_000_000_000
    assert steps.take(10 * second) == 0.0
    assert steps.take(10 * second + 5_000_000) == pytest.approx(0.005)
    assert steps.take(10 * second + 5_000_000) is None
    assert steps.take(9 * second) is None
    assert steps.take(10 * second + 10_000_000) == pytest.approx(0.005)
    assert steps.take(20 * second) == pytest.approx(9.99)
