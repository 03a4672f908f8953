"""The driver beside the Beego's pipeline reads real lines, and never makes up a way."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lodeline.loading import load_node, shipped
from lodeline.node import Context, Driver
from lodeline_msgs import WheelTicks

BEEGO = shipped("profiles") / "robots" / "beego"
TICK = 10_000_000  # ns


class Stand:
    """The driver on a pseudo-terminal, with a clock that tests turn."""

    def __init__(self, port: Path | str) -> None:
        kind = load_node(BEEGO / "counters.py")
        assert issubclass(kind, Driver)
        self.driver: Driver[Any] = kind(kind.params_type()(port=str(port)), Context("counters"))
        self.sent: list[tuple[int, int]] = []
        self.driver.senders["wheels"].sinks.append(self.take)
        self.stamp = 0

    def take(self, message: object) -> None:
        assert isinstance(message, WheelTicks)
        self.sent.append((message.left, message.right))

    def tick(self, times: int = 1) -> list[tuple[int, int]]:
        """Tick so often; what was sent meanwhile."""
        before = len(self.sent)
        for _ in range(times):
            self.stamp += TICK
            self.driver.tick(self.stamp)
        return self.sent[before:]

    @property
    def said(self) -> tuple[str, str]:
        return self.driver.context.state, self.driver.context.last_error


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """A serial line: the end to write into, and the device at the other."""
    ours, theirs = os.openpty()
    yield ours, os.ttyname(theirs)
    os.close(theirs)
    os.close(ours)


def test_increments_become_cumulative_counts_from_the_first_line_on(
    terminal: tuple[int, str],
) -> None:
    line, device = terminal
    stand = Stand(device)
    assert stand.tick() == []
    os.write(line, b"# time counter1 counter2 pwm1 pwm2\n0.00 900 900 1 1\n")
    assert stand.tick() == [(0, 0)], "what was before the first line, nobody knows"
    os.write(line, b"0.01 5 -3 1 1\n0.02, 6, -4\n0.03 7")
    assert stand.tick() == [(11, -7)]
    assert stand.tick() == [], "half a line says nothing"
    os.write(line, b" 1\n")
    assert stand.tick() == [(18, -6)]
    assert stand.said[0] == "running"


def test_a_line_that_says_nothing_is_counted_and_left_out(terminal: tuple[int, str]) -> None:
    line, device = terminal
    stand = Stand(device)
    stand.tick()
    os.write(line, b"0 0 0\n\xff\xfe 1\n0.01 nan 3\n0.02 2 2\n")
    stand.tick()
    assert stand.driver.context.rejected == {"bad line": 2}


def test_a_silence_is_a_fault_and_a_new_beginning(terminal: tuple[int, str]) -> None:
    line, device = terminal
    stand = Stand(device)
    stand.tick()
    os.write(line, b"0 0 0\n0.01 50 50\n")
    stand.tick()
    assert stand.tick(60) == []
    assert stand.said[0] == "fault"
    assert stand.said[1].startswith(f"COUNTERS_SILENT {device}: no line for 0.5 s")
    os.write(line, b"0.7 400 400\n")
    assert stand.tick() == [(0, 0)]
    os.write(line, b"0.71 4 4\n")
    assert stand.tick() == [(4, 4)]
    assert stand.said[0] == "running"


def test_a_port_that_is_unplugged_is_named_and_used_again(tmp_path: Path) -> None:
    port = tmp_path / "port"
    stand = Stand(port)
    stand.tick()
    text = f"COUNTERS_GONE {port}: No such file or directory - is it plugged in?"
    assert stand.said == ("fault", text)
    for _ in range(2):
        ours, theirs = os.openpty()
        port.symlink_to(os.ttyname(theirs))
        stand.tick(55)
        os.write(ours, b"0 7 7\n0.01 3 3\n")
        assert stand.tick() == [(0, 0)]
        os.write(ours, b"0.02 3 3\n")
        assert stand.tick() == [(3, 3)]
        os.close(theirs)
        os.close(ours)
        port.unlink()
        assert stand.tick() == []
        assert stand.said[0] == "fault"
        assert stand.said[1].startswith(f"COUNTERS_GONE {port}")


def test_a_pipe_does_as_well(tmp_path: Path) -> None:
    pipe = tmp_path / "motors"
    os.mkfifo(pipe)
    stand = Stand(pipe)
    assert stand.tick() == [], "nobody writes yet"
    writer = os.open(pipe, os.O_WRONLY)
    os.write(writer, b"0 0 0\n")
    assert stand.tick() == [(0, 0)]
    os.write(writer, b"0.01 1 2\n")
    assert stand.tick() == [(1, 2)]
    os.close(writer)
