"""Claims about `lodeline topic` beside the default pipeline, and about tools that outlive one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import pytest

from lodeline.pipeline.load import load
from lodeline.sessions import Client
from lodeline_msgs import Twist, encoding_of, field_specs, unpack
from tests.support.live import ROOT, Up, environment, eventually


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


def start(up: Up, *words: str, output: IO[str] | int = subprocess.PIPE) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", *words],
        env=environment(up.run),
        stdout=output,
        stderr=subprocess.PIPE if output == subprocess.PIPE else subprocess.STDOUT,
        text=True,
    )


def answer(up: Up, *words: str) -> Any:
    result = up.call("topic", *words, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_info_has_the_fields_of_the_class_and_the_policies_of_the_file(up: Up) -> None:
    info = answer(up, "info", "wheels")
    edges = {
        spec.name: edge
        for spec in load(ROOT / "pipeline.yaml").nodes
        for edge in spec.inputs.values()
        if edge.key == "rover/wheels"
    }
    assert (info["class"], info["node"]) == ("WheelTicks", "encoders")
    assert {name: (seen["queue"], seen["max_age"]) for name, seen in info["to"].items()} == {
        name: (edge.queue, edge.max_age) for name, edge in edges.items()
    }
    assert eventually(lambda: answer(up, "info", "wheels")["to"]["odometry"]["received"] > 50)
    text = up.call("topic", "info", "attitude").stdout
    for spec in field_specs(type_of("AttitudeEstimate")):
        assert any(
            line.split()[:2] == [spec.name, spec.unit.unit or "-"] for line in text.split("\n")
        )
    assert "no node reads it" not in text  # the ekf does
    assert "no node reads it" in up.call("topic", "info", "truth").stdout


def type_of(name: str) -> Any:
    from lodeline_msgs import MESSAGES

    return MESSAGES[name]


def test_a_node_tells_of_itself_on_a_key_too(up: Up) -> None:
    assert answer(up, "info", "status/ekf")["class"] == "NodeStatus"
    result = up.call("topic", "echo", "status/ekf", "-n", "1", "--json", "--timeout", "10")
    assert json.loads(result.stdout)["node"] == "ekf"
    counted = up.call("topic", "hz", "imu")  # not status/imu: what is counted are samples
    assert (counted.returncode, counted.stdout) == (4, "")
    assert "no key 'imu' in rover, did you mean 'imu/mag'?" in counted.stderr


def test_bandwidth_is_what_goes_over_the_bus(up: Up) -> None:
    sizes: list[int] = []
    client = Client(up.folder)
    client.subscribe("rover/imu/data", 256, lambda _key, data, _encoding: sizes.append(len(data)))

    def whole_second() -> bool:
        (row,) = answer(up, "bw", "imu/data")
        mean = sum(sizes) / len(sizes)
        return bool(row["rate"]) and abs(row["bandwidth"] / row["rate"] / mean - 1.0) < 0.03

    try:
        assert eventually(lambda: len(sizes) > 100)
        assert eventually(whole_second, 10.0, 0.5)
    finally:
        client.close()


def test_delay_shows_the_age_at_each_reader(up: Up) -> None:
    def ages() -> list[tuple[float, float]]:
        return [
            (seen["age_p50"], seen["age_p99"])
            for row in answer(up, "delay", "odom", "imu/data")
            for seen in row["to"].values()
            if seen["age_p50"] is not None
        ]

    assert eventually(lambda: len(ages()) == 2)
    for median, worst in ages():
        assert 0.0 < median <= worst < 0.5


def test_what_is_published_arrives_checked_stamped_and_numbered(up: Up) -> None:
    got: list[Twist] = []
    encodings: set[str] = set()
    lock = threading.Lock()

    def take(_key: str, data: bytes, encoding: str) -> None:
        with lock:
            got.append(unpack(data, Twist))
            encodings.add(encoding)

    def reader() -> dict[str, int]:
        seen = answer(up, "info", "cmd_vel")["to"]["simulator"]
        return {name: seen[name] or 0 for name in ("received", "lost", "late")}

    before = reader()
    client = Client(up.folder)
    client.subscribe("rover/cmd_vel", 256, take)
    try:
        begun = time.time_ns()
        sent = up.call("topic", "pub", "cmd_vel", "{v: 5e-2}", "w=0", "--rate", "50", "-n", "25")
        assert sent.returncode == 0, sent.stderr
        assert eventually(lambda: len(got) == 25, 5.0)
    finally:
        client.close()
    assert encodings == {encoding_of(Twist)}
    assert [message.seq for message in got] == list(range(25))
    assert {(message.v, message.w) for message in got} == {(0.05, 0.0)}
    assert all(begun <= message.stamp <= time.time_ns() for message in got)
    # Never faster than told; how much slower is the machine's affair.
    assert 0.45 < (got[-1].stamp - got[0].stamp) * 1e-9 < 5.0
    # The simulator keeps the newest only: it took most of them, and knows what became of each
    # after the first that it saw.
    assert eventually(lambda: sum(reader().values()) >= sum(before.values()) + 24, 10.0, 0.3)
    assert reader()["received"] - before["received"] > 12


@pytest.mark.parametrize(
    ("words", "code", "reason"),
    [
        (("pose", "x=1"), 2, "pose comes from node ekf"),
        (("status/ekf", "pid=1"), 2, "comes from node ekf"),
        (("cmd_vel", "v=1"), 2, "field 'w' is missing"),
        (("cmd_vel", "v=fast", "w=0"), 2, "Twist.v: str where a number is expected"),
        (("cmd_vel", "v=.nan", "w=0"), 2, "not a finite number"),
        (("cmd_vel", "v=1", "w=0", "vw=0"), 2, "no field 'vw'"),
        (("cmd_vel", "{v: 1"), 2, "no YAML"),
        (("cmd_vel", "v"), 2, "neither a map in braces nor field=value"),
        (("cmd_vell", "v=1", "w=0"), 4, "did you mean 'cmd_vel'?"),
    ],
)
def test_what_must_not_be_published_is_refused(
    up: Up, words: tuple[str, ...], code: int, reason: str
) -> None:
    result = up.call("topic", "pub", *words)
    assert (result.returncode, result.stdout) == (code, "")
    assert reason in result.stderr


def test_whoever_waits_says_for_what(up: Up) -> None:
    result = up.call("topic", "echo", "cmd_vel", "--timeout", "2.5")
    assert result.returncode == 1
    assert result.stderr == "waiting for a sample of rover/cmd_vel\n"


def test_echo_into_a_pipe_that_closes_ends(up: Up) -> None:
    process = start(up, "topic", "echo", "pose", "--json")
    assert process.stdout is not None
    first = json.loads(process.stdout.readline())
    assert "covariance" in first
    process.stdout.close()
    assert process.wait(5.0) == 1
    assert process.stderr is not None
    assert process.stderr.read() == ""


def test_samples_of_a_recording_need_no_pipeline(up: Up, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    recorded = up.call("bag", "record", "imu/mag", "-o", str(file), "--seconds", "1")
    assert recorded.returncode == 0, recorded.stderr
    elsewhere = {"LODELINE_RUN": str(tmp_path / "nothing-runs-here")}

    def echo(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-P", "-m", "lodeline", "topic", "echo", *words]
        return subprocess.run(
            [*command, "--bag", str(file), "--json"],
            env=environment(up.run) | elsewhere,
            capture_output=True,
            text=True,
            timeout=20.0,
        )

    samples = [json.loads(line) for line in echo("mag", "-n", "20").stdout.splitlines()]
    assert [sample["seq"] - samples[0]["seq"] for sample in samples] == list(range(20))
    wrong = echo("magg")
    assert wrong.returncode == 4
    assert "did you mean 'imu/mag'?" in wrong.stderr


def test_a_supervisor_that_stands_still_is_named(up: Up) -> None:
    pid = up.process.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        listed = up.call("topic", "list")
        restarted = up.call("restart", "ekf")
    finally:
        os.kill(pid, signal.SIGCONT)
    said = f"rover runs, but its supervisor, pid {pid}, is silent\n"
    assert (listed.returncode, listed.stdout, listed.stderr) == (4, "", said)
    assert (restarted.returncode, restarted.stdout) == (1, "")
    assert restarted.stderr == "ekf: its supervisor does not answer\n"


def test_tools_end_when_their_pipeline_does(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    codes = {
        ("topic", "hz", "-f"): 4,
        ("topic", "echo", "cmd_vel"): 4,
        ("top",): 4,
        ("logs", "-f"): 0,
        ("bag", "record", "-o", str(file)): 0,
    }
    with Up(ROOT / "pipeline.yaml") as up, ExitStack() as stack:
        shown = {
            words: stack.enter_context((tmp_path / "-".join(words[:2])).open("w+"))
            for words in codes
        }
        tools = {words: start(up, *words, output=shown[words]) for words in codes}
        assert eventually(lambda: file.exists() and file.stat().st_size > 10_000, 30.0)
        assert eventually(
            lambda: all(
                Path(each.name).stat().st_size for words, each in shown.items() if words[0] != "bag"
            ),
            30.0,
        )
        assert all(tool.poll() is None for tool in tools.values())
        up.stop(signal.SIGINT)
        assert {words: tool.wait(10.0) for words, tool in tools.items()} == codes
        for words, each in shown.items():
            each.seek(0)
            end = "the pipeline ended, nothing lost" if words[0] == "bag" else "rover runs no more"
            assert each.read().splitlines()[-1].endswith(end), words
    assert file.read_bytes().endswith(b"\x89MCAP0\r\n")
