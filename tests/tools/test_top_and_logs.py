"""Claims about `lodeline top` and `lodeline logs` beside the default pipeline."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.live import ROOT, Up, environment, eventually


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


def top(up: Up) -> dict[str, dict[str, Any]]:
    result = up.call("top", "--once", "--json")
    assert result.returncode == 0, result.stderr
    return {row["node"]: row for row in json.loads(result.stdout)}


class Follower:
    """A tool that goes on, and the lines that it has printed."""

    def __init__(self, up: Up, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "lodeline", *words],
            env=environment(up.run),
            stdout=subprocess.PIPE,
            text=True,
        )
        self.lines: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(self.process.stdout)

    def says(self, text: str) -> bool:
        return any(text in line for line in list(self.lines))

    def interrupt(self) -> int:
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(5.0)


def test_top_has_a_row_of_each_node_with_its_figures(up: Up) -> None:
    assert eventually(
        lambda: all(row["state"] == "running" and row["rates"] for row in top(up).values()), 10.0
    )
    rows = top(up)
    assert list(rows) == list(up.running.manifest.nodes)
    for row in rows.values():
        assert row["host"] == "robot"
        assert row["restarts"] == 0
        assert 0.0 < row["cpu"] < 1.0
        assert 10e6 < row["rss"] < 200e6
    assert set(rows["imu"]["rates"]) == {"imu/data_raw", "imu/mag_raw"}
    assert 0.0 < rows["ekf"]["age_p50"] <= rows["ekf"]["age_p99"]
    assert rows["imu"]["age_p50"] is None
    text = up.call("top", "--once").stdout.splitlines()
    assert text[0].split()[:3] == ["NODE", "HOST", "STATE"]
    assert len(text) == 1 + len(rows)


def test_top_on_a_terminal_is_refreshed_in_place_and_leaves_it_as_it_was(up: Up) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", "top"],
        env=environment(up.run, COLUMNS="100", LINES="30", TERM="xterm"),
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    )
    os.close(theirs)
    seen = b""
    while seen.count(b"\x1b[H") < 3:  # three pictures, each at the top left corner
        seen += os.read(ours, 65536)
    process.send_signal(signal.SIGINT)
    while process.poll() is None:
        try:
            seen += os.read(ours, 65536)
        except OSError:  # the terminal's other end is closed
            break
    assert process.wait(5.0) == 130
    os.close(ours)
    assert seen.startswith(b"\x1b[?1049h")
    assert seen.rstrip().endswith(b"\x1b[?25h\x1b[?1049l")
    pictures = seen.split(b"\x1b[H")[1:4]
    assert all(picture.count(b"running") == 9 for picture in pictures[:2])
    lines = re.sub(rb"\x1b\[[0-9;?]*[A-Za-z]", b"", pictures[0]).splitlines()
    assert max(map(len, lines)) <= 100


def test_a_killed_node_shows_in_top_and_in_the_log_of_whoever_follows(up: Up) -> None:
    follower = Follower(up, "logs", "-f", "magnets")
    others = Follower(up, "logs", "-f", "encoders")
    assert eventually(lambda: follower.process.poll() is None and other_tool_listens(up))
    os.kill(up.ps()["magnets"]["pid"], signal.SIGKILL)
    assert eventually(lambda: follower.says("NODE_EXIT magnets: SIGKILL, restart 1"), 3.0)
    assert eventually(lambda: top(up)["magnets"]["restarts"] == 1, 5.0)
    assert eventually(lambda: top(up)["magnets"]["state"] == "running", 5.0)
    assert [follower.interrupt(), others.interrupt()] == [130, 130]
    assert sum("NODE_EXIT" in line for line in follower.lines) == 1
    assert not others.says("magnets")


def other_tool_listens(up: Up) -> bool:
    """Whether log lines come through by now: ask for one of our own."""
    result = up.call("logs", "-n", "1", "--json")
    return result.returncode == 0 and bool(result.stdout)


def test_logs_are_what_the_supervisor_shows(up: Up) -> None:
    """What the supervisor says meanwhile is in the later answer alone."""
    shown = [line.partition("| ")[2].rstrip("\n") for line in list(up.log)]
    newest = up.call("logs", "-n", "2").stdout.splitlines()
    lines = [json.loads(line) for line in up.call("logs", "--json").stdout.splitlines()]
    assert [line["n"] for line in lines] == list(range(len(lines)))
    assert {line["host"] for line in lines} == {"robot"}
    texts = [line["text"] for line in lines]
    assert texts[: len(shown)] == shown
    assert all(abs(line["time"] - time.time()) < 300.0 for line in lines)
    two = [line.partition("| ")[2] for line in newest]
    assert two in [texts[end - 2 : end] for end in range(len(shown), len(texts) + 1)]
    assert re.fullmatch(r"\d\d:\d\d:\d\d\.\d{3} \S+ +\| .*", newest[0])


def test_logs_of_an_unknown_node_name_the_nearest(up: Up) -> None:
    result = up.call("logs", "odometri")
    assert (result.returncode, result.stdout) == (4, "")
    assert "did you mean 'odometry'?" in result.stderr


def test_whoever_watches_rates_and_health_is_sent_no_sample(up: Up) -> None:
    """A node packs and sends only what somebody listens to, and counts the bytes."""
    watchers = [Follower(up, *words) for words in (("topic", "hz", "-f"), ("top",), ("logs", "-f"))]

    def bytes_of_pose() -> list[float]:
        result = up.call("topic", "bw", "pose", "--json")
        return [row["bandwidth"] for row in json.loads(result.stdout)]

    try:
        assert eventually(lambda: all(watcher.lines for watcher in watchers), 20.0)
        rows = {len(watcher.lines) for watcher in watchers[:2]}
        assert eventually(
            lambda: all(len(watcher.lines) > max(rows) for watcher in watchers[:2]), 20.0
        )
        assert bytes_of_pose() == [0.0]
        watchers.append(Follower(up, "topic", "echo", "pose"))
        assert eventually(lambda: bytes_of_pose()[0] > 1000.0, 20.0)
    finally:
        for watcher in watchers:
            watcher.interrupt()
