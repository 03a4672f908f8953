"""Claims about the work that one sample costs, in steps of the interpreter: no clock is asked.

A step count is the same on a busy machine. One that grows by a quarter fails here; who has a
reason writes the new count down. Half of it fails too: then nothing is guarded any more.
"""

from __future__ import annotations

import math
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from lodeline.attitude.soft import Soft, SoftParams
from lodeline.clock import HostClock, epoch_offset
from lodeline.ekf import Localizer, LocalizerParams
from lodeline.graph import Graph
from lodeline.inlet import Inlet
from lodeline.intake import Edge, Intake
from lodeline.node import Input, Node, Output
from lodeline.odometry import Odometry as Wheels
from lodeline.odometry import OdometryParams
from lodeline.recent import Recent
from lodeline.recording.read import Recording
from lodeline.recording.write import RecordingWriter
from lodeline.rotation import IDENTITY
from lodeline.status import Outlet
from lodeline_msgs import Odometry, pack, packer_of, unpacker_of

TOLERANCE = 1.25
MANY, FEW = 300, 30


class Sent:
    """In place of a publisher of zenoh: what was put on the bus."""

    key = "rover/odom"
    watched = True

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.put = self.data.append


class Pass(Node[OdometryParams]):
    """Makes a new message of each that comes."""

    odom = Input(Odometry)
    out = Output(Odometry)

    @odom.handler
    def on_odom(self, odom: Odometry) -> None:
        self.out.send(moved(odom.stamp))


def moved(stamp: int) -> Odometry:
    nine, four = (1e-4,) * 9, (1e-5,) * 4
    return Odometry(stamp, 1.0, 2.0, 0.3, 0.1, 0.2, nine, four, 0.01)


def steps(work: Callable[[], object]) -> int:
    """How many instructions of Python's virtual machine some work takes, in all its calls."""
    count = 0

    def trace(frame: FrameType, event: str, _value: Any) -> Any:
        nonlocal count
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        count += event == "opcode"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(before)
    return count


def each(take: Callable[[int], object]) -> float:
    """Steps for one sample, long after the first; `take(n)` takes the n-th."""
    for number in range(MANY):
        take(number)
    return steps(lambda: [take(MANY + number) for number in range(FEW)]) / FEW


def hop(watched: bool) -> Callable[[int], object]:
    """From bytes off the bus through intake, inlet, handler and outlet to bytes on the bus."""
    node, sent, clock = Pass(OdometryParams()), Sent(), HostClock(epoch_offset())
    sent.watched = watched
    graph = Graph({"pass": node}, {"pass": {"odom": "in"}}, {"pass": {"out": "out"}})
    graph.tap("out", Outlet(sent, Recent("pass")))  # type: ignore[arg-type]
    inlet = Inlet("in", Odometry, 100.0, clock, node.context.reject, graph.ports["pass", "odom"])
    way = Intake(threading.RLock())
    edge = Edge(way, inlet, 1)
    began = clock.now()
    data = [pack(replace(moved(began + n), seq=n)) for n in range(MANY + FEW)]

    def take(number: int) -> None:
        way.bus_free_at = 0.0
        edge.arrive("", data[number])
        while number == 0 and inlet.received == 0:  # only the first goes by the other thread
            time.sleep(1e-3)
        assert inlet.received == number + 1
        assert len(sent.data) == (number + 1 if watched else 0)

    return take


def attitude() -> Callable[[int], object]:
    soft = Soft(SoftParams())
    north, up = (0.0, 20e-6, -40e-6), (0.0, 0.0, 9.81)
    return lambda number: soft.update(0.01, (0.0, 0.0, 0.1), up, north if number % 2 else None)


def wheels() -> Callable[[int], object]:
    odometry = Wheels(OdometryParams())
    return lambda number: odometry.update(10_000_000 * (number + 1), number, number)


def ekf(gyro: bool) -> Callable[[int], object]:
    """Odometry at 100 Hz, a reading of the reed bar, mostly empty, between every two, and with the
    gyro two of its readings.
    """
    localizer = Localizer(LocalizerParams())
    four = (1e-6, 0.0, 0.0, 1e-6)

    def take(number: int) -> None:
        stamp = 10_000_000 * (number + 1)
        localizer.odometry(stamp, 1e-4 * number, 0.0, 0.0, four, 0.01, 0)
        localizer.magnets(stamp + 5_000_000, ())
        for after in (1_000_000, 6_000_000) if gyro else ():
            spin(localizer, stamp + after)

    return take


def spin(localizer: Localizer, stamp: int, rate: float = 0.01) -> None:
    localizer.attitude(stamp, IDENTITY, (0.0, 0.0, rate), 0.1, disturbed=False)


def ekf_with_late_gyro() -> Callable[[int], object]:
    """Two readings of the gyro for each odometry, with which it agrees; the later one comes when
    the odometry that passes it has been: as out of the FIFO of a chip.
    """
    localizer = Localizer(LocalizerParams())
    four = (1e-6, 0.0, 0.0, 1e-6)

    def take(number: int) -> None:
        stamp = 10_000_000 * (number + 1)
        spin(localizer, stamp - 7_000_000, 0.0)
        localizer.odometry(stamp, 1e-4 * number, 0.0, 0.0, four, 0.01, 0)
        spin(localizer, stamp - 2_000_000, 0.0)

    return take


def ekf_without_wheels() -> Callable[[int], object]:
    """Gyro at 200 Hz and no odometry yet: it cannot be used, however much of it comes."""
    localizer = Localizer(LocalizerParams())
    return lambda number: spin(localizer, 5_000_000 * (number + 1))


def replayed() -> Callable[[int], object]:
    """A recorded sample through a node of a replay, with its digest."""
    node, digest = Pass(OdometryParams()), sha256()
    graph = Graph({"pass": node}, {"pass": {"odom": "in"}}, {"pass": {"out": "out"}})
    packed = packer_of(Odometry)
    graph.tap("out", lambda message: digest.update(b"out" + packed(message)))
    unpack, data = unpacker_of(Odometry), pack(moved(0))
    return lambda _: graph.deliver("in", unpack(data))


def recorded() -> Callable[[int], object]:
    """A sample out of a recording, on every other key of which nobody asks for anything."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two.mcap"
        with file.open("wb") as stream:
            writer = RecordingWriter(stream, {})
            for number in range(MANY + FEW):
                writer.write("odom", moved(number))
                writer.write("other", moved(number))
            writer.close()
        samples = Recording(file).samples(["odom"])
        next(samples)  # what is open outlives its name

    return lambda number: number + 1 < MANY + FEW and next(samples)


PATHS: dict[str, tuple[Callable[[], Callable[[int], object]], int]] = {
    "a hop between processes": (lambda: hop(True), 920),
    "a hop that nobody listens to": (lambda: hop(False), 850),
    "attitude": (attitude, 1730),
    "odometry": (wheels, 770),
    "ekf": (lambda: ekf(gyro=False), 2840),
    "ekf with gyro": (lambda: ekf(gyro=True), 4430),
    "ekf without wheels": (ekf_without_wheels, 440),
    "ekf with late gyro": (ekf_with_late_gyro, 3860),
    "a sample of a replay": (replayed, 640),
    "a sample out of a recording": (recorded, 600),
}
"""What is guarded, and the steps that a sample takes there with CPython 3.11."""


@pytest.mark.parametrize("name", PATHS)
def test_a_sample_costs_no_more_steps_than_written_down(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lodeline.intake.QUICK_S", math.inf)  # counted, every handler is slow
    make, known = PATHS[name]
    found = each(make())
    assert found <= TOLERANCE * known, f"{name}: {found:.0f} steps, {known} were known"
    assert found >= known / 2, f"{name}: {found:.0f} steps, {known} were known: write it down"


def test_counting_sees_work_inside_of_calls() -> None:
    assert steps(lambda: sum(n for n in range(1000))) > 1000
