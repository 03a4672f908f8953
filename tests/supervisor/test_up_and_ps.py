"""Claims about `lodeline up` and `lodeline ps`, over real nodes on the real bus."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.supervisor.talk import Talk, alive
from tests.support.live import eventually, living

ROOT = Path(__file__).parents[2]
NODES = Path(__file__).parent / "nodes"

PIPELINE = f"""\
name: little
nodes:
  source: {{run: {NODES}/ticks.py, outputs: {{wheels: wheels}}}}
  ekf: {{run: {NODES}/teller.py, inputs: {{wheels: wheels}}, cpu: 0}}
  sink: {{run: {NODES}/teller.py, inputs: {{wheels: wheels}}, params: {{word: saw}}}}
"""
TWO_HOSTS = f"""\
name: pair
hosts: {{robot: {{listen: 127.0.0.1}}, laptop: {{connect: 127.0.0.1}}}}
nodes:
  source: {{run: {NODES}/ticks.py, host: robot, outputs: {{wheels: wheels}}}}
  sink: {{run: {NODES}/teller.py, host: laptop, inputs: {{wheels: wheels}}}}
"""
Up = Callable[..., Talk]


class Shell:
    """A shell in a folder with pipeline files, with run folders of its own."""

    def __init__(self, folder: Path, base: Path) -> None:
        self.folder = folder
        self.environment = os.environ | {"LODELINE_RUN": str(base)}

    def write(self, text: str, name: str = "pipeline.yaml") -> None:
        (self.folder / name).write_text(text)

    def command(self, verb: str, *words: str) -> list[str]:
        return [sys.executable, "-P", str(ROOT / "tools" / f"{verb}.py"), *words]

    def run(self, verb: str, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(verb, *words),
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=20,
        )

    def ps(self) -> list[dict[str, Any]]:
        answer: list[dict[str, Any]] = json.loads(self.run("ps", "--json").stdout)
        return answer


@pytest.fixture
def shell(tmp_path: Path, run_base: Path) -> Shell:
    return Shell(tmp_path, run_base)


@pytest.fixture
def up(shell: Shell) -> Iterator[Up]:
    started: list[Talk] = []

    def start(*words: str) -> Talk:
        started.append(Talk(shell.command("up", *words), shell.environment, shell.folder))
        return started[-1]

    yield start
    for talk in started:
        with contextlib.suppress(ProcessLookupError):
            talk.process.send_signal(signal.SIGCONT)
            talk.process.send_signal(signal.SIGTERM)
        talk.end()


def test_a_pipeline_runs_for_its_seconds_and_loses_no_sample_at_its_start(
    shell: Shell, up: Up
) -> None:
    shell.write(PIPELINE)
    talk = up("--seconds", "1")
    assert talk.end() == 0
    first, ready, hint = talk.said("lodeline", ".*")[:3]
    assert first[0] == "pipeline.yaml: little on robot, 3 nodes in 3 processes"
    assert ready[0].startswith("up in ") and ready[0].endswith(" s: 3 nodes in 3 processes")
    assert "lodeline ps" in hint[0]
    for name, word in (("ekf", "got"), ("sink", "saw")):
        numbers = [int(match[1]) for match in talk.said(name, rf"{word} (\d+)")]
        assert len(numbers) >= 40
        assert numbers == list(range(len(numbers)))


def test_ps_shows_what_runs_and_what_was_granted(shell: Shell, up: Up) -> None:
    shell.write(PIPELINE)
    talk = up()
    talk.wait("sink", r"saw \d+")
    (report,) = shell.ps()
    assert (report["pipeline"], report["host"]) == ("little", "robot")
    assert report["pid"] == talk.process.pid
    processes = {item["process"]: item for item in report["processes"]}
    assert list(processes) == ["source", "ekf", "sink"]
    for item in processes.values():
        assert item["state"] == "running"
        assert item["nodes"] == [item["process"]]
        assert item["restarts"] == 0
        assert item["rss"] > 5_000_000
        assert alive(item["pid"])
    assert processes["ekf"]["scheduling"] == "cpu 0"
    assert os.sched_getaffinity(processes["ekf"]["pid"]) == {0}
    table = shell.run("ps", "--name", "little")
    assert table.returncode == 0
    assert [line.split()[0] for line in table.stdout.splitlines()] == [
        "little",
        "PROCESS",
        "source",
        "ekf",
        "sink",
    ]


def test_ps_has_nothing_to_show_where_nothing_runs(shell: Shell) -> None:
    for words in ((), ("--name", "little"), ("--json",)):
        result = shell.run("ps", *words)
        assert (result.returncode, result.stdout) == (4, "")
        assert "run" in result.stderr


def test_ps_names_a_supervisor_that_does_not_answer(shell: Shell, up: Up) -> None:
    shell.write(PIPELINE)
    talk = up()
    talk.wait("sink", r"saw \d+")
    talk.signal(signal.SIGSTOP)
    result = shell.run("ps")
    talk.signal(signal.SIGCONT)
    assert result.returncode == 1
    assert f"pid {talk.process.pid}, is silent" in result.stderr


def test_a_killed_node_takes_part_again_and_the_others_miss_nothing(shell: Shell, up: Up) -> None:
    shell.write(PIPELINE)
    talk = up()
    talk.wait("sink", r"saw \d+")
    processes = {item["process"]: item for item in shell.ps()[0]["processes"]}
    talk.wait("ekf", r"got \d+")
    os.kill(processes["ekf"]["pid"], signal.SIGKILL)
    talk.wait("lodeline", "NODE_EXIT ekf: SIGKILL, restart 1")
    heard = len(talk.said("ekf", r"got \d+"))
    talk.wait("ekf", r"got \d+", heard + 20)
    after = {item["process"]: item for item in shell.ps()[0]["processes"]}
    assert after["ekf"]["restarts"] == 1
    assert after["ekf"]["last_exit"] == "SIGKILL"
    assert after["sink"]["pid"] == processes["sink"]["pid"]
    seen = [int(match[1]) for match in talk.said("sink", r"saw (\d+)")]
    assert seen == list(range(len(seen)))


def test_a_second_up_is_refused_and_the_first_goes_on(shell: Shell, up: Up) -> None:
    shell.write(PIPELINE)
    talk = up()
    talk.wait("sink", r"saw \d+")
    second = shell.run("up")
    assert second.returncode == 1
    assert f"ALREADY_UP little@robot: pid {talk.process.pid} since " in second.stderr
    heard = len(talk.said("sink", r"saw \d+"))
    talk.wait("sink", r"saw \d+", heard + 10)


def test_an_interrupt_ends_it_with_130_and_nothing_runs_any_more(shell: Shell, up: Up) -> None:
    shell.write(PIPELINE)
    talk = up()
    talk.wait("sink", r"saw \d+")
    talk.signal(signal.SIGINT)
    assert talk.end() == 130
    assert shell.run("ps").returncode == 4


def cut_power(up: Talk, base: Path) -> None:
    """Kill a supervisor, its guard and its nodes as one."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parents[int(entry.name)] = int(
                (entry / "stat").read_text().rpartition(")")[2].split()[1]
            )
    family = {up.process.pid}
    while more := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= more
    for number in (signal.SIGSTOP, signal.SIGKILL):
        for pid in [*family, *living(f"NOTIFY_SOCKET={base}/")]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)
    up.end()


@pytest.mark.parametrize(
    ("moment", "damage"),
    [
        (("lodeline", "pipeline.yaml: little"), lambda data: b""),
        (("sink", r"saw 5"), lambda data: data[: len(data) // 2] + bytes(len(data) // 2)),
    ],
    ids=["empty", "half zeros"],
)
def test_after_a_power_cut_the_next_up_removes_what_was_left_and_says_so(
    shell: Shell,
    up: Up,
    run_base: Path,
    moment: tuple[str, str],
    damage: Callable[[bytes], bytes],
) -> None:
    shell.write(PIPELINE)
    first = up()
    first.wait(*moment)
    assert eventually(lambda: any(run_base.rglob("manifest.json")))
    cut_power(first, run_base)
    spoilt = [file for file in run_base.rglob("*") if file.is_file()]
    for file in spoilt:  # as a disk has them that was never told to write them down
        file.write_bytes(damage(file.read_bytes()))
    assert {"manifest.json", "robot.lock"} <= {file.name for file in spoilt}
    assert shell.run("ps").returncode == 4
    second = up()
    second.wait("lodeline", r"LEFTOVER files of a run that died were removed, \d+ process")
    second.wait("sink", r"saw \d+")
    assert not first.said("lodeline", "LEFTOVER")
    assert shell.run("logs", "sink").returncode == 0


def test_an_edited_file_changes_nothing_that_runs_and_ps_and_check_say_so(
    shell: Shell, up: Up
) -> None:
    shell.write(PIPELINE)
    talk = up()
    talk.wait("sink", r"saw \d+")
    assert "EDITED" not in shell.run("ps", "--check").stderr + shell.run("check").stderr
    pids = [item["pid"] for item in shell.ps()[0]["processes"]]
    shell.write(PIPELINE.replace("word: saw", "word: caught"))
    words = "EDITED pipeline.yaml: takes effect with the next `lodeline up`"
    shown = shell.run("ps", "--check")
    assert shown.returncode == 0, "what runs is well"
    assert words in shown.stdout
    assert f"little@robot: {words}" in shown.stderr
    assert f"little@robot: {words}" in shell.run("check").stderr
    (report,) = shell.ps()
    assert report["edited"] == [str(shell.folder / "pipeline.yaml")]
    assert [item["pid"] for item in report["processes"]] == pids
    heard = len(talk.said("sink", r"saw \d+"))
    talk.wait("sink", r"saw \d+", heard + 5)
    shell.write(PIPELINE)
    assert shell.ps()[0]["edited"] == []


def test_without_a_host_one_machine_plays_them_all(shell: Shell, up: Up) -> None:
    shell.write(TWO_HOSTS)
    talk = up()
    talk.wait("sink", r"got \d+")
    (report,) = shell.ps()
    assert report["host"] == "laptop+robot"
    assert [item["host"] for item in report["processes"]] == ["robot", "laptop"]


def test_with_a_host_only_its_share_runs(shell: Shell, up: Up) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    shell.write(TWO_HOSTS.replace("127.0.0.1", f"127.0.0.1:{port}"))
    talk = up("--host", "robot", "--seconds", "0.2")
    assert talk.end() == 0
    assert "pair on robot, 1 node in 1 process" in talk.said("lodeline", ".*")[0][0]


def test_an_invalid_pipeline_starts_nothing(shell: Shell) -> None:
    shell.write(PIPELINE.replace("outputs", "ouputs").replace("cpu: 0", "cpu: no"))
    result = shell.run("up")
    assert result.returncode == 3
    assert "pipeline.yaml:3:" in result.stderr and "pipeline.yaml:4:" in result.stderr
    assert shell.run("ps").returncode == 4


@pytest.mark.parametrize("words", [("--host", "labtop"), ("--seconds", "-1"), ("--seconds", "x")])
def test_wrong_usage_is_code_2(shell: Shell, words: tuple[str, ...]) -> None:
    shell.write(TWO_HOSTS)
    result = shell.run("up", *words)
    assert result.returncode == 2
    assert words[1] in result.stderr


def test_parameters_can_be_set_for_one_run(shell: Shell, up: Up) -> None:
    shell.write(PIPELINE)
    talk = up("--seconds", "0.3", "--set", "sink.word=heard", "pipeline.yaml")
    assert talk.end() == 0
    assert talk.said("sink", r"heard \d+")
