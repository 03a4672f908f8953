"""Claims about processes that are started, released, die, hang and come back."""

from __future__ import annotations

import os
import signal
import time

import pytest

from tests.supervisor.talk import Start, alive, patience, until


def test_sources_go_when_the_last_process_is_linked(supervise: Start) -> None:
    up = supervise(("source", "good"), ("sink", "slow"))
    up.wait("sink", "order go")
    up.wait("source", "order go")
    ready = float(up.wait("sink", r"ready at (\S+)")[1])
    assert float(up.wait("source", r"order go at (\S+)")[1]) > ready
    assert float(up.wait("source", r"ready at (\S+)")[1]) < ready - 0.2


def test_sources_go_all_the_same_when_a_wire_is_missing_and_it_is_named(supervise: Start) -> None:
    began = time.monotonic()
    up = supervise(("source", "good"), ("sink", "unlinked"), link=0.5)
    up.wait("lodeline", r"NOT_LINKED sink \(ready\): going on after 0.5 s")
    up.wait("source", "order go")
    assert time.monotonic() - began > 0.5


def test_a_killed_node_is_back_within_a_second_and_its_neighbours_stay(supervise: Start) -> None:
    up = supervise(("source", "good"), ("ekf", "good"), ("sink", "good"))
    for name in ("source", "ekf", "sink"):
        up.wait(name, "order go")
    pids = {name: up.pid(name) for name in ("source", "ekf", "sink")}
    began = time.monotonic()
    os.kill(pids["ekf"], signal.SIGKILL)
    up.wait("ekf", "order go", 2)
    assert time.monotonic() - began < 1.0 * patience()
    up.wait("lodeline", r"NODE_EXIT ekf: SIGKILL, restart 1 in 0\.1 s")
    assert up.pid("ekf", 2) != pids["ekf"]
    assert up.wait("ekf", r"launch #(\d)", 2)[1] == "1"
    assert (up.starts("source"), up.starts("sink")) == (1, 1)
    assert alive(pids["source"]) and alive(pids["sink"])


def test_a_node_that_spins_is_aborted_with_a_stack_and_comes_back(supervise: Start) -> None:
    up = supervise(("ekf", "spin"), ("sink", "good"), watchdog=1.0)
    up.wait("ekf", "start")
    began = time.monotonic()
    up.wait("lodeline", "NODE_SILENT ekf for 1 s")
    up.wait("lodeline", r"NODE_EXIT ekf: SIGABRT, restart 1")
    up.wait("ekf", "start", 2)  # by then all is said about its predecessor
    assert time.monotonic() - began < 2.5 * patience()
    assert up.said("ekf", r".*in spin_without_a_beat")
    assert up.said("lodeline", r"  ekf said: .*in spin_without_a_beat")
    assert up.starts("sink") == 1


def test_a_stopped_node_is_killed_and_comes_back(supervise: Start) -> None:
    up = supervise(("ekf", "good"), ("sink", "good"))
    up.wait("ekf", "order go")
    began = time.monotonic()
    os.kill(up.pid("ekf"), signal.SIGSTOP)
    up.wait("ekf", "order go", 2)
    assert 1.5 < time.monotonic() - began < 3.5 * patience()
    assert up.said("lodeline", "NODE_EXIT ekf: SIGKILL")
    assert up.starts("sink") == 1


def test_a_beat_counts_only_from_the_process_itself(supervise: Start) -> None:
    up = supervise(("ekf", "forge"), watchdog=1.0)
    assert up.wait("lodeline", r"NODE_SILENT ekf for (\S+) s")[1] == "1"


def test_a_node_that_never_gets_ready_is_treated_as_crashed(supervise: Start) -> None:
    up = supervise(("imu", "never-ready"), ready=0.5)
    up.wait("imu", "start")
    began = time.monotonic()
    up.wait("lodeline", "NOT_READY imu after 0.5 s")
    assert up.wait("lodeline", r"NODE_EXIT imu: (\w+), restart (\d)").groups() == ("SIGABRT", "1")
    assert time.monotonic() - began < 1.0 * patience()
    assert up.pid("imu", 2) != up.pid("imu", 1)


def test_a_crash_loop_ends_after_six_starts_while_the_others_go_on(supervise: Start) -> None:
    up = supervise(("bad", "crash"), ("sink", "good"), backoff={"first": 0.01})
    up.wait(
        "lodeline",
        "NODE_FAILED bad: exit 1, given up after start 6: mend it, `lodeline restart bad`",
    )
    assert up.wait("lodeline", "  bad said: RuntimeError: broken on purpose")
    up.wait("lodeline", "released")
    assert up.starts("bad") == 6
    assert up.starts("sink") == 1
    assert alive(up.pid("sink"))


def test_a_driver_is_started_for_ever(supervise: Start) -> None:
    options = {"restart": "always"}
    up = supervise(("imu", "crash", options), backoff={"first": 0.01, "longest": 0.02})
    up.wait("imu", "start", 10)
    assert not up.said("lodeline", "NODE_FAILED")


def test_a_node_that_is_never_restarted_fails_at_once(supervise: Start) -> None:
    up = supervise(("tool", "exit-70", {"restart": "never"}), ("sink", "good"))
    up.wait("lodeline", "NODE_FAILED tool: exit 70")
    up.wait("lodeline", "released")
    assert up.starts("tool") == 1


@pytest.mark.parametrize("code", [64, 78])
def test_bad_configuration_is_not_tried_again(supervise: Start, code: int) -> None:
    up = supervise(("bad", f"exit-{code}", {"restart": "always"}), ("sink", "good"))
    up.wait("lodeline", f"NODE_FAILED bad: exit {code}, not started again: mend it, stop")
    up.wait("lodeline", "released")
    assert up.starts("bad") == 1


def test_a_driver_that_met_the_wrong_device_looks_again_after_two_seconds(supervise: Start) -> None:
    up = supervise(("imu", "exit-69", {"restart": "always"}), ("sink", "good"))
    assert up.wait("lodeline", r"NODE_EXIT imu: exit 69, restart 1 in (\S+) s")[1] == "2.0"


def test_a_required_node_that_failed_ends_all_with_code_5(supervise: Start) -> None:
    up = supervise(("source", "good"), ("ekf", "exit-78", {"required": True}))
    assert up.end() == 5
    assert up.report()["source"]["state"] == "stopped"


def test_the_run_is_over_with_code_0_when_all_nodes_are_done(supervise: Start) -> None:
    up = supervise(("player", "done", {"restart": "always"}), ("other", "done"))
    assert up.end() == 0
    assert up.said("lodeline", "NODE_DONE player")
    assert up.starts("player") == 1


def test_the_run_is_over_with_code_5_when_the_last_node_failed(supervise: Start) -> None:
    up = supervise(("only", "exit-78"))
    assert up.end() == 5


def test_a_helper_goes_with_its_node(supervise: Start) -> None:
    up = supervise(("imu", "tree"))
    found = up.wait("imu", r"helpers (\d+) (\d+) (\d+) (\d+)").groups()
    near, _, still, bare = map(int, found)
    os.kill(up.pid("imu"), signal.SIGKILL)
    up.wait("imu", "start", 2)
    assert not any(map(alive, (near, still, bare)))


@pytest.mark.parametrize("who", ["the supervisor", "the machine"])
def test_nodes_outlive_a_pause(supervise: Start, who: str) -> None:
    up = supervise(("source", "good"), ("sink", "good"), watchdog=1.0)
    for name in ("source", "sink"):
        up.wait(name, "order go")
    nodes = [up.pid("source"), up.pid("sink")]
    paused = [up.process.pid, *(nodes if who == "the machine" else [])]
    for pid in paused:
        os.kill(pid, signal.SIGSTOP)
    began = time.monotonic()
    until(lambda: time.monotonic() - began > 1.5, 3.0)
    for pid in paused:
        os.kill(pid, signal.SIGCONT)
    until(lambda: time.monotonic() - began > 3.0, 5.0)
    assert not up.said("lodeline", "NODE_SILENT")
    assert [up.pid("source"), up.pid("sink")] == nodes
    assert all(map(alive, nodes))


def test_nodes_see_no_more_of_the_environment_than_they_need(supervise: Start) -> None:
    up = supervise(("imu", "good"))
    assert up.wait("imu", r"launch #0 secret (\w+)")[1] == "unseen"


def test_a_leaking_process_is_warned_of_then_killed_before_it_takes_a_fifth_more(
    supervise: Start,
) -> None:
    up = supervise(("plot", "leak", {"memory": 60_000_000}), ("sink", "good"))
    up.wait("lodeline", r"RSS_HIGH plot: (4[89]|5\d) MB of 60 allowed by rss_mb")
    killed = up.wait("lodeline", r"RSS plot: (\d+) MB of 60 allowed by rss_mb: killed")
    assert 60 <= int(killed[1]) < 72
    up.wait("lodeline", "NODE_EXIT plot: SIGKILL, restart 1")
    up.wait("plot", "order go", 2)
    assert up.starts("sink") == 1
