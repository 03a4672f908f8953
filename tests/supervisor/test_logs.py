"""Claims about what nodes print: bounded, harmless, and in nobody's way."""

from __future__ import annotations

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from lodeline.supervisor.logs import LogPipe, clean
from tests.supervisor.talk import Start, patience, until

HERE = Path(__file__).parent


def test_a_flood_is_cut_to_200_lines_a_second_and_the_rest_is_counted(supervise: Start) -> None:
    up = supervise(("noisy", "flood"), ("sink", "good"))
    up.wait("sink", "order go")

    def dropped() -> int:
        return sum(int(match[1]) for match in up.said("noisy", r"LOG (\d+) lines dropped"))

    def shown() -> int:
        return len(up.said("noisy", r"flood (\d+|over)"))

    until(lambda: shown() + dropped() == 50_001, 10.0)
    assert shown() <= 600
    up.signal(signal.SIGTERM)
    assert up.end() == 0
    assert shown() + dropped() == 50_001
    assert (up.starts("noisy"), up.starts("sink")) == (1, 1)


def test_the_last_lines_before_a_crash_are_shown_even_out_of_a_flood(supervise: Start) -> None:
    up = supervise(("noisy", "flood-and-die"))
    up.wait("lodeline", "  noisy said: RuntimeError: after the flood")
    assert len(up.said("lodeline", "  noisy said: ")) <= 20


def test_what_a_node_prints_cannot_steer_the_terminal(supervise: Start) -> None:
    up = supervise(("rogue", "escape"))
    up.wait("rogue", "red")
    assert up.said("rogue", re.escape(r"red \x1b]0;title\x07 bell") + "$")


def test_text_stays_as_it_is() -> None:
    assert clean("Größe\t5 µT → 3 °C\r") == "Größe\t5 µT → 3 °C"


def test_a_terminal_that_stands_still_does_not_hold_up_the_supervisor(run_base: Path) -> None:
    nodes = [["noisy", "flood", {}], ["sink", "good", {}]]
    order = json.dumps({"nodes": nodes, "seconds": 1.0, "timing": {}})
    # Nobody reads this pipe, and it is full after 4 kB of the flood.
    reader, terminal = os.pipe()
    fcntl.fcntl(terminal, fcntl.F_SETPIPE_SZ, 4096)
    process = subprocess.Popen(
        [sys.executable, "-P", str(HERE / "fake_up.py"), order],
        env=os.environ | {"LODELINE_RUN": str(run_base)},
        stdout=subprocess.DEVNULL,
        stderr=terminal,
    )
    began = time.monotonic()
    try:
        assert process.wait(10.0) == 0
        assert time.monotonic() - began < 4.0 * patience()
        shown = os.read(reader, 1 << 16)
        assert b"flood" in shown
        assert b"report" not in shown, "the last line came through: nothing stood still"
    finally:
        process.kill()
        process.wait()
        os.close(reader)
        os.close(terminal)


def test_a_line_without_an_end_is_shown_when_its_node_is_gone() -> None:
    lines: list[str] = []
    pipe = LogPipe(lines.append, lambda: 0.0)
    os.write(pipe.writer, b"first\nsecond")
    os.close(pipe.writer)
    pipe.drain()
    pipe.close()
    assert lines == ["first", "second"]
    assert pipe.ended


def test_a_flood_without_line_ends_does_not_grow_without_bounds() -> None:
    lines: list[str] = []
    pipe = LogPipe(lines.append, lambda: 0.0)
    os.write(pipe.writer, b"x" * 500_000)
    while pipe.read():
        pass
    os.close(pipe.writer)
    pipe.close()
    assert 0 < len(lines) <= 500_000 // 8192
    assert max(map(len, lines)) == 8192


def test_a_quiet_node_earns_its_lines_back() -> None:
    now = 0.0
    lines: list[str] = []
    pipe = LogPipe(lines.append, lambda: now)
    os.write(pipe.writer, b"a\n" * 300)
    pipe.read()
    assert len(lines) == 200
    pipe.report_dropped()
    assert lines[-1] == "LOG 100 lines dropped: more than 200 a second"
    now = 0.5
    os.write(pipe.writer, b"b\n" * 300)
    pipe.read()
    os.close(pipe.writer)
    pipe.close()
    assert lines.count("b") == 100
