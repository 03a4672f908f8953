"""Claims about hosts whose clocks differ: the bar is honest, and ages go by one of them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from math import inf
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.bench.cable import Cable, Fault
from lodeline.hosts import certificates
from lodeline.hosts.offset import NodeTime, Offset, better, measured
from lodeline.terminal.traffic import delay_table
from tests.hosts.net import Host, Net, hosts_at
from tests.support.live import environment, eventually

SKEW_S = 600
# UNIX time of one process set forward, its monotonic clock left as it is.
SHIM = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>
int clock_gettime(clockid_t id, struct timespec *at) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(id, at);
    if (!result && id == CLOCK_REALTIME) at->tv_sec += %d;
    return result;
}
"""

# zenoh as it comes, in its mode `router`: open to everybody.
OPEN_ROUTER = """
import zenoh
config = zenoh.Config()
config.insert_json5("mode", '"router"')
with zenoh.open(config):
    print(flush=True)
    input()
"""


def skew(host: Host, seconds: int, folder: Path) -> None:
    """Let a host that is yet to start live so far in the future."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler for a clock that is wrong")
    source, library = folder / "skew.c", folder / "skew.so"
    source.write_text(SHIM % seconds)
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True
    )
    place = host._command.index("--") + 1
    host._command[place:place] = ["env", f"LD_PRELOAD={library}"]


def doctor(host: Host, what: str) -> dict[str, Any]:
    """What `lodeline doctor WHAT --json` says on a machine."""
    command = [sys.executable, "-P", "-m", "lodeline", "doctor", what, "--json"]
    done = subprocess.run(
        host.machine.command(*command),
        env=environment(host.run),
        capture_output=True,
        text=True,
        check=False,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found | {"code": done.returncode}


def test_the_doctor_says_who_is_linked_and_what_is_open(net: Net) -> None:
    file = net.file()
    robot = Host(net.robot, file, "robot")
    seen = doctor(robot, "net")
    assert seen["code"] == 4
    assert [check["verdict"] for check in seen["checks"]] == ["skip", "ok"]
    assert seen["checks"][0]["text"].startswith("no pipeline runs here")
    with robot:
        seen = doctor(robot, "clock")
        verdicts = {check["name"]: (check["verdict"], check["fix"]) for check in seen["checks"]}
        fix = "`lodeline doctor net` says whether it is up and linked"
        assert verdicts == {"clock of robot": ("ok", ""), "clock of laptop": ("FAIL", fix)}
        assert seen["code"] == 1
        seen = doctor(robot, "net")
        assert [check["verdict"] for check in seen["checks"]] == ["warn", "ok"]
        assert seen["checks"][1]["text"] == f"tcp {net.address}:7447 is open on one address"
        with Host(net.laptop, file, "laptop") as laptop:
            assert eventually(lambda: robot.linked("laptop"), 10.0, 0.1)
            seen = doctor(laptop, "net")
            assert [check["verdict"] for check in seen["checks"]] == ["ok", "ok", "ok"]
            assert seen["checks"][2]["text"] == "no port of zenoh is open"
            stranger = subprocess.Popen(
                net.laptop.command(sys.executable, "-c", OPEN_ROUTER),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            assert stranger.stdin is not None and stranger.stdout is not None
            stranger.stdout.readline()
            seen = doctor(laptop, "net")
            stranger.communicate(b"\n")
            assert seen["code"] == 1
            texts = [check["text"] for check in seen["checks"] if check["verdict"] == "FAIL"]
            assert texts == ["OPEN_PORT tcp :::7447 accepts zenoh on every network of this machine"]


@pytest.fixture
def cable(net: Net) -> Iterator[Cable]:
    """A second way between the machines, to be spoilt by a thread of this process."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-4)
    made = Cable(net.robot, net.laptop)
    yield made
    made.close()
    sys.setswitchinterval(interval)


@pytest.mark.parametrize(
    ("late", "fault"),
    [(False, Fault(delay=0.020, jitter=0.015)), (True, Fault())],
    ids=["robot first, 20 +- 15 ms away", "laptop first"],
)
def test_a_laptop_ten_minutes_ahead_takes_the_robots_time(
    net: Net, cable: Cable, late: bool, fault: Fault, tmp_path: Path
) -> None:
    cable.fault = fault
    file = net.file(hosts=hosts_at(cable.addresses[0]))
    robot, laptop = Host(net.robot, file, "robot"), Host(net.laptop, file, "laptop")
    skew(laptop, SKEW_S, tmp_path)
    first, second = (laptop, robot) if late else (robot, laptop)
    with first, second:
        # The watcher refuses what is older than its limit: with the wrong time, everything.
        assert eventually(lambda: laptop.received("watcher", "speed") > 100, 15.0, 0.2)
        assert eventually(lambda: bar_of(laptop, "robot") < 0.030, 10.0, 0.2)
        clock = laptop.links()["robot"]["clock"]
        assert abs(clock["offset"] + SKEW_S) <= min(0.020, clock["error"] + 0.002)
        assert clock["error"] > 0.0
        assert eventually(lambda: robot.links()["laptop"]["clock"] is not None, 10.0, 0.2)
        assert robot.links()["laptop"]["clock"]["offset"] == pytest.approx(SKEW_S, abs=0.5)
        (row,) = json.loads(laptop.call("topic", "delay", "--json", "speed").stdout)
        seen = row["to"]["watcher"]
        assert -seen["age_error"] <= seen["age_p50"] < 1.0
        assert re.search(r"its clock -(600\.0|599\.9)\d+ s \+- ", laptop.call("ps").stdout)
        said = doctor(laptop, "clock")
        (check,) = [check for check in said["checks"] if check["verdict"] == "warn"]
        assert check["name"] == "clock of laptop" and "set-ntp" in check["fix"]
        assert re.match(r"\+(6000|5999)\d\d\.\d+ \+- \d+\.\d+ ms ahead", check["text"])
        clocks = said["hosts"]
        apart = clocks["laptop"]["offset"] - clocks["robot"]["offset"]
        bar = clocks["laptop"]["error"] + clocks["robot"]["error"]
        assert apart == pytest.approx(SKEW_S, abs=bar + 0.001)
        assert bar < 0.2


def bar_of(host: Host, other: str) -> float:
    """How well [s] a host knows the clock of another; infinite if not at all."""
    clock = host.links()[other]["clock"]
    return float(clock["error"]) if clock else inf


def test_a_robot_that_lives_before_its_certificate_suspects_its_clock(
    net: Net, tmp_path: Path
) -> None:
    pytest.importorskip("cryptography")
    certificates.init(tmp_path / "keys")
    certificates.add(tmp_path / "keys", "robot", [net.address])
    robot = Host(net.robot, net.file(more=f"tls: {tmp_path / 'keys'}"), "robot")
    skew(robot, -10 * 365 * 86400, tmp_path)
    with pytest.raises(
        AssertionError, match=r"here it is 20\d\d-.*: is the clock of this host wrong"
    ):
        robot.__enter__()
    assert robot.process.returncode == 1


@pytest.mark.parametrize(
    ("error", "shown"),
    [(None, "(12.00 ms ?)"), (0.0015, "12.00 ms +-1.5"), (0.0, "12.00 ms")],
    ids=["two clocks never compared", "two clocks", "one clock"],
)
def test_an_age_without_a_bar_is_marked_as_doubtful(error: float | None, shown: str) -> None:
    seen = {"age_p50": 0.012, "age_p99": 0.012, "age_error": error, "lost": 0, "late": 0}
    table = delay_table([{"key": "speed", "to": {"watcher": seen}}])
    assert table.splitlines()[1].count(shown) == 2
    assert ("?" in table) is (error is None)


@given(
    skew=st.integers(-(10**12), 10**12),
    there=st.integers(0, 50_000_000),
    back=st.integers(0, 50_000_000),
)
def test_the_bar_holds_however_unlike_the_ways_are(skew: int, there: int, back: int) -> None:
    sent = 10**18
    found = measured(sent, sent + there + skew, sent + there + back, 0)
    assert abs(found.seconds - skew * 1e-9) <= found.error + 1e-6


def test_a_bar_grows_with_its_age_until_a_better_one_comes() -> None:
    good = Offset(0.010, 0.001, 0)
    minute = 60 * 10**9
    assert good.aged(minute) == pytest.approx(0.007)
    poor = Offset(0.012, 0.005, 10**9)
    assert better(good, poor, 10**9) is good
    assert better(good, poor, 2 * minute) is poor


def test_a_clock_that_was_set_is_believed_at_once() -> None:
    assert better(Offset(0.0, 0.001, 0), Offset(5.0, 0.01, 10**9), 10**9).seconds == 5.0


def test_nodes_are_told_only_of_a_change_that_can_be_seen() -> None:
    time = NodeTime(own=1000, reference="robot")
    assert not time.follow("tablet", Offset(600.0, 0.001, 0))
    assert not time.follow("robot", Offset(0.0015, 0.001, 0))
    assert time.follow("robot", Offset(-600.0, 0.001, 0))
    assert time.epoch() == 1000 - 600 * 10**9
    assert not time.follow("robot", Offset(-600.0005, 0.001, 0))
