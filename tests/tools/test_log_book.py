"""Claims about log lines on their way to whoever looks: bounded, each once, none lost in a gap."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any, cast

import pytest

from lodeline.supervisor.logbook import KEPT_BYTES, LogBook
from lodeline.terminal.log_lines import Lines, is_about, line_text
from lodeline.watch import Watch
from tests.support.live import eventually


class Wire:
    """A publisher whose listeners come and go."""

    def __init__(self) -> None:
        self.watched = False
        self.on_watched: Callable[[], None] = lambda: None
        self.sent: list[dict[str, Any]] = []

    def put(self, data: bytes) -> None:
        self.sent += json.loads(data)

    def listen(self) -> None:
        self.watched = True
        self.on_watched()


def test_a_node_that_never_stops_talking_does_not_fill_the_memory() -> None:
    book = LogBook()
    for i in range(20_000):
        book.add("noisy", f"{i} " + "ü" * 100)
    data = book.kept()
    lines = json.loads(data)
    assert len(data) < 2 * KEPT_BYTES
    assert lines[-1]["text"].startswith("19999 ")
    assert [line["n"] for line in lines] == list(range(lines[0]["n"], 20_000))


def test_lines_go_out_only_while_somebody_listens() -> None:
    now = [1000.0]
    book, wire = LogBook(lambda: now[0]), Wire()
    book.publish(wire)
    book.add("imu", "long ago")
    now[0] += 60.0
    book.add("imu", "just now")
    assert wire.sent == []
    wire.listen()
    assert eventually(lambda: [line["text"] for line in wire.sent] == ["just now"])
    book.add("ekf", "next")
    assert eventually(lambda: len(wire.sent) == 2)
    book.add("ekf", "last words")
    book.close()
    assert [line["n"] for line in wire.sent] == [1, 2, 3]
    assert not any(thread.name == "log" for thread in threading.enumerate())


def test_nothing_goes_out_when_the_last_listener_has_left() -> None:
    book, wire = LogBook(), Wire()
    book.publish(wire)
    wire.listen()
    book.add("imu", "heard")
    assert eventually(lambda: len(wire.sent) == 1)
    wire.watched = False
    book.add("imu", "unheard")
    book.close()
    assert [line["text"] for line in wire.sent] == ["heard"]


class FakeWatch:
    """A watch whose supervisor keeps the lines that the test says."""

    class manifest:  # noqa: N801 - stands for an attribute
        name = "rover"

    def __init__(self) -> None:
        self.kept: list[dict[str, Any]] = []
        self.take: Callable[[str, bytes, str], None] = lambda _key, _data, _encoding: None

    def subscribe(self, _key: str, _queue: int, take: Callable[[str, bytes, str], None]) -> None:
        self.take = take

    def ask(self, _what: str) -> dict[str, Any]:
        return {"robot": self.kept}

    def say(self, *numbers: int, heard: bool = True) -> None:
        lines = [{"n": n, "time": float(n), "name": "imu", "text": f"{n}"} for n in numbers]
        self.kept = [line for line in self.kept if line["n"] not in numbers] + lines
        if heard:
            self.take("rover/@log/robot", json.dumps(lines).encode(), "application/json")


@pytest.fixture
def fake() -> FakeWatch:
    return FakeWatch()


def numbers(lines: list[dict[str, Any]]) -> list[int]:
    return [line["n"] for line in lines]


def test_each_line_comes_once_whether_kept_or_new_or_both(fake: FakeWatch) -> None:
    lines = Lines(cast(Watch, fake))
    fake.say(0, 1, heard=False)
    lines.follow()
    fake.say(1, 2)
    assert numbers(lines.kept()) == [0, 1, 2]
    fake.say(3)
    assert numbers(lines.new()) == [3]
    assert lines.new() == []


def test_lines_that_were_missed_on_the_way_are_asked_for(fake: FakeWatch) -> None:
    lines = Lines(cast(Watch, fake))
    lines.follow()
    fake.say(0)
    assert numbers(lines.kept()) == [0]
    fake.say(1, 2, heard=False)
    fake.say(3)
    assert numbers(lines.new()) == [1, 2, 3]


def test_the_log_of_a_node_has_what_the_supervisor_says_of_it() -> None:
    event = {"name": "lodeline", "text": "NODE_EXIT imu: SIGKILL, restart 1 in 0.1 s"}
    assert is_about(event, {"imu"})
    assert not is_about(event, {"imu2"})
    assert not is_about({"name": "ekf", "text": "imu is late"}, {"imu"})
    assert is_about({"name": "ekf", "text": "imu is late"}, set())


def test_names_are_coloured_only_on_demand() -> None:
    line = {"n": 0, "time": 0.25, "name": "imu", "text": "hello"}
    assert line_text(line, ["lodeline", "imu"], coloured=False).endswith(".250 imu      | hello")
    assert "\x1b[36mimu     \x1b[0m | hello" in line_text(line, ["lodeline", "imu"], coloured=True)
