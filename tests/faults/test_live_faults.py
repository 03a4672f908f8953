"""Claims about a pipeline with everything wrong in it: each fault is named, the rest goes on."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest

from lodeline.dash.gateway import Gateway
from lodeline.memory import resident
from lodeline.sessions import Client
from lodeline.watch import Watch
from lodeline_msgs import NodeStatus, Twist, WheelTicks, encoding_of, pack, unpack
from tests.dash.support import Reader, connecting
from tests.faults.nodes.stuck import ENOUGH
from tests.faults.test_hostile_samples import BROKEN
from tests.supervisor.talk import patience
from tests.support.live import Up, environment, eventually

NODES = Path(__file__).parent / "nodes"
PIPELINE = f"""
name: faulty
external: {{command: Twist}}
nodes:
  source: {{run: {NODES}/wheels.py, outputs: {{wheels: wheels}}, rate: {{wheels: 100}}}}
  half:
    run: {NODES}/wheels.py
    outputs: {{wheels: half}}
    params: {{rate: 50}}
    rate: {{wheels: 100}}
  mute:
    run: {NODES}/wheels.py
    outputs: {{wheels: mute}}
    params: {{most: 300}}
    rate: {{wheels: 100}}
  relay:
    run: {NODES}/relay.py
    inputs: {{wheels: wheels, command: command}}
    outputs: {{back: back}}
  clumsy:
    run: {NODES}/relay.py
    inputs: {{wheels: wheels, command: command}}
    outputs: {{back: clumsy}}
    params: {{trips: 10}}
  slow:
    run: {NODES}/relay.py
    inputs: {{wheels: {{key: wheels, queue: 1}}, command: command}}
    outputs: {{back: slow}}
    params: {{pause: 0.05}}
  stuck: {{run: {NODES}/stuck.py, inputs: {{wheels: wheels}}, outputs: {{back: stuck}}}}
  waits:
    run: {NODES}/stuck.py
    inputs: {{wheels: wheels}}
    outputs: {{back: waits}}
    params: {{ever: wait}}
  sulky:
    run: {NODES}/sulky.py
    outputs: {{wheels: sulky}}
    rate: {{wheels: 100}}
    restart_on_silence: true
  unfounded: {{run: {NODES}/unfounded.py, inputs: {{wheels: wheels}}}}
"""


OF_ANY_CLASS = ("truncated", "malformed", "no map")


ENDED = {"sulky", "stuck", "waits"}


class Rig:
    """The pipeline, a listener to what the relay sends, and a way to send what nobody should."""

    def __init__(self, up: Up, watch: Watch) -> None:
        self.up = up
        self.client = Client(up.folder)
        self.watch = watch
        self.back: list[WheelTicks] = []
        self.client.subscribe("faulty/back", 1024, self._take)

    def _take(self, _key: str, data: bytes, _encoding: str) -> None:
        self.back.append(unpack(data, WheelTicks))

    def status(self, node: str) -> NodeStatus:
        # Without patience: the node that cannot be imported never says anything.
        assert eventually(lambda: node in self.watch.statuses(0.0))
        return self.watch.statuses(0.0)[node]

    def pids(self) -> dict[str, int]:
        """Of all processes but those that end for what they do wrong, at their time."""
        ended, processes = ENDED | {"unfounded"}, self.up.ps().items()
        return {name: process["pid"] for name, process in processes if name not in ended}

    def publisher(self, key: str, message: type[Any]) -> Any:
        publisher = self.client.publisher(f"faulty/{key}", encoding_of(message))
        assert eventually(lambda: publisher.watched)
        return publisher

    def rejected(self, cause: str) -> int:
        return self.status("relay").rejected.get(cause, 0)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    file = tmp_path_factory.mktemp("faulty") / "faulty.yaml"
    file.write_text(PIPELINE)
    with Up(file) as up, Watch(up.running) as watch:
        made = Rig(up, watch)
        yield made
        made.client.close()


def test_a_missing_library_is_named_and_its_node_given_up_while_the_others_go_on(rig: Rig) -> None:
    assert eventually(lambda: rig.up.says("NODE_FAILED unfounded: exit 1"), 30.0)
    assert eventually(lambda: rig.up.says("No module named 'a_library_that_nobody_has'"))
    assert eventually(lambda: rig.up.ps()["unfounded"]["state"] == "failed")
    processes = rig.up.ps()
    restarted = {name for name, process in processes.items() if process["restarts"]}
    assert restarted - ENDED == {"unfounded"}


@pytest.mark.parametrize("node", ["stuck", "waits"])
def test_a_handler_that_never_returns_is_aborted_with_its_stack(rig: Rig, node: str) -> None:
    """`stuck` holds the interpreter, `waits` waits for a lock that it holds itself."""
    assert eventually(lambda: rig.up.says(f"NODE_SILENT {node} for 2 s: aborted"), 20.0)
    assert eventually(lambda: rig.up.says(f"NODE_EXIT {node}: SIGABRT, restart 1"))
    silent, ended = (
        next(line for line in rig.up.log if words in line)
        for words in (f"NODE_SILENT {node}", f"NODE_EXIT {node}")
    )
    assert clock(ended) - clock(silent) < 1.0 * patience()
    stack = re.compile(rf" {node} +\| .* in on_wheels")
    assert eventually(lambda: any(map(stack.search, list(rig.up.log))))
    assert eventually(lambda: rig.status(node).restarts == 1)
    assert eventually(lambda: rig.status(node).received["faulty/wheels"] > ENOUGH)


def test_who_beats_but_sends_nothing_is_started_again_where_the_file_says_so(rig: Rig) -> None:
    assert eventually(lambda: rig.up.says("GIVING_UP sulky: nothing sent for 5 s"), 20.0)
    assert eventually(lambda: rig.up.says("NODE_EXIT sulky: exit 70, restart 1"))
    silent = next(line for line in rig.up.log if "NO_DATA faulty/sulky: nothing for" in line)
    ended = next(line for line in rig.up.log if "NODE_EXIT sulky" in line)
    since = clock(silent) - float(silent.split("nothing for ")[1].split()[0])
    assert 4.9 < clock(ended) - since < 7.0 * patience()
    assert eventually(lambda: rig.up.ps()["sulky"]["restarts"] == 1)
    assert eventually(lambda: rig.status("sulky").rates["faulty/sulky"] > 50.0)


def clock(line: str) -> float:
    """Seconds since midnight at the head of a log line."""
    hours, minutes, seconds = line.split()[0].split(":")
    return int(hours) * 3600.0 + int(minutes) * 60.0 + float(seconds)


def test_check_names_what_is_not_well_and_exits_with_5_for_a_failed_process(rig: Rig) -> None:
    said: list[str] = []

    def all_named() -> bool:
        result = rig.up.call("ps", "--check")
        said[:] = [str(result.returncode), result.stderr]
        wanted = (
            r"faulty@\S+ half: RATE faulty/half: \d+\.\d Hz, 100 declared",
            r"faulty@\S+ mute: NO_DATA faulty/mute: nothing for \d+\.\d s, 100 Hz declared",
            r"faulty@\S+ unfounded: failed, last exit exit 1",
            r"faulty@\S+ clumsy: EXCEPTIONS clumsy: \d+ in the last second, the last ValueError",
        )
        return result.returncode == 5 and all(re.search(line, said[1]) for line in wanted)

    assert eventually(all_named, 20.0, 0.5), said
    assert " relay: " not in said[1]


def test_the_page_is_told_of_a_rate_that_is_off_and_of_silence(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LODELINE_RUN", str(rig.up.run))

    async def told() -> dict[str, tuple[str, str]]:
        async with Gateway("faulty") as gateway, connecting(gateway.port) as socket:
            reader = Reader(socket)
            await reader.say(do="hello", token="")
            nodes: dict[str, Any] = {}
            while not {"half", "mute"} <= nodes.keys():
                nodes = (await reader.hear("status"))["nodes"]
            return {name: (nodes[name]["state"], nodes[name]["last_error"]) for name in nodes}

    shown = asyncio.run(told())
    assert shown["half"][0] == "degraded"
    assert re.match(r"RATE faulty/half: \d+\.\d Hz, 100 declared", shown["half"][1])
    assert shown["mute"][0] == "fault"
    assert shown["mute"][1].startswith("NO_DATA faulty/mute: nothing for ")


@pytest.fixture(scope="module")
def well(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """The pipeline without all that is wrong in it."""
    file = tmp_path_factory.mktemp("well") / "well.yaml"
    head, *nodes = re.split(r"(?m)^(?=  \w+:)", PIPELINE.partition("nodes:\n")[2])
    kept = [node for node in (head, *nodes) if node.strip().startswith(("source:", "relay:"))]
    file.write_text(PIPELINE.partition("nodes:\n")[0] + "nodes:\n" + "".join(kept))
    with Up(file) as up:
        yield up


def test_check_finds_nothing_wrong_where_all_is_well(well: Up) -> None:
    assert eventually(lambda: well.call("ps", "--check").returncode == 0, 20.0, 0.5)
    assert set(well.ps()) == {"source", "relay"}


def test_a_supervisor_that_stands_still_costs_no_sample_and_no_process(well: Up) -> None:
    before = well.ps()
    with Watch(well.running) as watch:
        first = watch.statuses(2.0)["relay"]
        well.process.send_signal(signal.SIGSTOP)
        time.sleep(3.0)  # how long the fault lasts
        well.process.send_signal(signal.SIGCONT)
        assert eventually(lambda: watch.statuses(2.0)["relay"].seq >= first.seq + 4)
        last = watch.statuses(2.0)["relay"]
    taken = last.received["faulty/wheels"] - first.received["faulty/wheels"]
    assert last.lost["faulty/wheels"] == first.lost["faulty/wheels"]
    missed = 0.05 if patience() == 1.0 else 0.2  # by a source that gets no processor
    assert taken > (1.0 - missed) * 100.0 * (last.stamp - first.stamp) * 1e-9
    assert {name: each["pid"] for name, each in well.ps().items()} == {
        name: each["pid"] for name, each in before.items()
    }


def test_a_tool_that_stands_still_holds_up_nobody(well: Up) -> None:
    echo = subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", "topic", "echo", "back"],
        env=environment(well.run),
        stdout=subprocess.PIPE,
    )
    assert echo.stdout is not None
    assert echo.stdout.readline()
    with Watch(well.running) as watch:
        first, hub = watch.statuses(2.0), resident(well.process.pid)
        echo.send_signal(signal.SIGSTOP)
        assert eventually(lambda: watch.statuses(2.0)["relay"].seq >= first["relay"].seq + 6)
        last = watch.statuses(2.0)
    echo.kill()
    echo.wait()
    echo.stdout.close()
    assert last["relay"].lost == first["relay"].lost
    taken = [each["relay"].received["faulty/wheels"] for each in (first, last)]
    seconds = (last["relay"].stamp - first["relay"].stamp) * 1e-9
    assert taken[1] - taken[0] > 80.0 / patience() * seconds
    assert last["relay"].age_p99["faulty/wheels"] < 0.05 * patience()
    assert last["relay"].rss < first["relay"].rss + 10e6
    assert resident(well.process.pid) < hub + 10e6


def test_a_frozen_node_does_not_hold_up_the_stop(well: Up) -> None:
    os.kill(well.ps()["relay"]["pid"], signal.SIGSTOP)
    began = time.monotonic()
    assert well.stop(signal.SIGTERM) == 0
    assert time.monotonic() - began < 3.0 * patience()


def test_a_slow_node_gets_the_newest_samples_and_costs_the_others_none(rig: Rig) -> None:
    first = {name: rig.status(name) for name in ("slow", "relay")}
    assert eventually(lambda: rig.status("slow").seq >= first["slow"].seq + 3)
    last = {name: rig.status(name) for name in ("slow", "relay")}
    lost = {name: last[name].lost["faulty/wheels"] for name in last}
    lost_before = {name: first[name].lost["faulty/wheels"] for name in first}
    assert lost["slow"] - lost_before["slow"] > 100, "of 300, and it knows"
    assert lost["relay"] == lost_before["relay"]
    assert last["slow"].age_p50["faulty/wheels"] < 0.02 * patience(), "two periods"


def test_an_exception_costs_its_sample_and_no_more(rig: Rig) -> None:
    before = rig.status("clumsy")
    assert eventually(lambda: rig.status("clumsy").seq >= before.seq + 2)
    after = rig.status("clumsy")
    assert after.pid == before.pid
    assert after.state == "degraded"
    tripped = after.rejected["exception"] - before.rejected["exception"]
    taken = after.received["faulty/wheels"] - before.received["faulty/wheels"]
    assert tripped == pytest.approx(taken / 10, abs=2)
    told = [line for line in [*rig.up.log] if "EXCEPTION clumsy: ValueError('tripped over" in line]
    assert len(told) == 1 + after.restarts, "with its traceback once, however often it is raised"
    assert after.rates["faulty/clumsy"] > 0.0


def test_a_foreign_sender_on_an_owned_key_is_seen_and_changes_nothing(rig: Rig) -> None:
    foreign = rig.publisher("wheels", WheelTicks)
    heard = len(rig.back)
    for seq in range(50):
        foreign.put(pack(WheelTicks(time.time_ns(), -1000, -1000, seq=10_000 + seq)))
    assert eventually(lambda: rig.rejected("foreign") == 50), rig.status("relay").rejected
    assert eventually(lambda: rig.up.says("REFUSED faulty/wheels: "))
    assert eventually(lambda: len(rig.back) > heard + 50)
    assert all(sample.left > 0 for sample in rig.back)
    assert rig.status("relay").lost["faulty/wheels"] < 1000


def test_a_corpus_of_broken_samples_is_counted_and_the_node_lives_on(rig: Rig) -> None:
    commands = rig.publisher("command", Twist)
    pids, before = rig.pids(), Counter(rig.status("relay").rejected)
    whole = {"stamp": time.time_ns(), "v": float("nan"), "w": 1.0}
    corpus = [
        *((data, cause) for data, cause, _ in BROKEN.values() if cause in OF_ANY_CLASS),
        (msgpack.packb(whole), "not finite"),
        (msgpack.packb(whole | {"v": "fast"}), "wrong type"),
        (msgpack.packb({"stamp": 1, "v": 1.0}), "missing field"),
        (b"\xff" * 60_000, "malformed"),
    ]
    for data, _ in corpus:
        commands.put(data)
    wanted = Counter(cause for _, cause in corpus)
    assert len(wanted) == 6

    def counted_and_said() -> bool:
        status = rig.status("relay")
        counted = Counter(status.rejected) - before == wanted
        said = status.last_error.startswith("REFUSED faulty/command: ")
        return counted and said and status.state == "degraded"

    assert eventually(counted_and_said), rig.status("relay")
    commands.put(pack(Twist(time.time_ns(), 7.0, 0.0, seq=1)))
    assert eventually(lambda: rig.back[-1].right == 7)
    assert rig.pids() == pids


def test_ten_megabytes_reach_nobody_and_the_next_sample_does(rig: Rig) -> None:
    pids, rss = rig.pids(), rig.status("relay").rss
    commands = rig.publisher("command", Twist)
    for _ in range(5):
        commands.put(bytes(10_000_000))
    again = rig.publisher("command", Twist)

    def taken() -> bool:
        again.put(pack(Twist(time.time_ns(), 8.0, 0.0, seq=2)))
        return rig.back[-1].right == 8

    assert eventually(taken, 20.0, 0.1)
    assert rig.pids() == pids
    assert rig.status("relay").rss < rss + 20e6


def flooded(rig: Rig) -> tuple[float, float]:
    """Samples a second that were sent for three seconds, and the oldest age p99 [s] of another key
    in them.
    """
    commands, ages = rig.publisher("command", Twist), list[float]()
    sent, began = 0, time.monotonic()
    while sent < 150_000:
        now = time.time_ns()
        for _ in range(500):
            commands.put(pack(Twist(now, 9.0, 0.0, seq=sent)))
            sent += 1
        ages.append(rig.status("relay").age_p99.get("faulty/wheels", 0.0))
        time.sleep(max(0.0, began + sent / 50_000.0 - time.monotonic()))
    return sent / (time.monotonic() - began), max(ages)


def test_fifty_thousand_samples_a_second_on_one_key_do_not_drown_another(rig: Rig) -> None:
    pids, before, heard = rig.pids(), rig.status("relay"), len(rig.back)
    rate, oldest = flooded(rig)
    assert rate > 45_000.0 / patience()
    assert eventually(lambda: rig.status("relay").seq >= before.seq + 5)
    after = rig.status("relay")
    assert after.lost["faulty/wheels"] == before.lost["faulty/wheels"]
    assert after.received["faulty/wheels"] - before.received["faulty/wheels"] > 250
    assert len(rig.back) - heard > 250, f"{len(rig.back) - heard} of 300 at {rate:.0f} a second"
    assert after.rss < before.rss + 20e6
    taken = after.received["faulty/command"] - before.received["faulty/command"]
    lost = after.lost["faulty/command"] - before.lost["faulty/command"]
    assert taken + lost > 100_000, "what was not taken is counted as lost"
    assert rig.pids() == pids
    print(f"{rate:.0f} a second, age p99 {oldest * 1e3:.1f} ms, {taken} taken, {lost} lost")
    if oldest >= 0.1 * patience():  # a machine that stood still for a moment does not do so again
        _, oldest = flooded(rig)
    assert oldest < 0.1 * patience()
