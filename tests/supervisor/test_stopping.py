"""Claims about how a run ends."""

from __future__ import annotations

import os
import signal
import time

import pytest

from tests.supervisor.talk import Start, Talk, alive, patience


def stopped_in(up: Talk, number: int) -> tuple[int, float]:
    """Exit code after a signal, and how long it took [s]."""
    began = time.monotonic()
    up.signal(number)
    return up.end(), time.monotonic() - began


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 0), (signal.SIGHUP, 0)]
)
def test_a_signal_stops_all_within_a_second_sources_first(
    supervise: Start, number: int, code: int
) -> None:
    names = ("source", "filter", "sink")
    up = supervise(*((name, "good") for name in names), order=3.0)
    up.wait("lodeline", "released")
    exit_code, seconds = stopped_in(up, number)
    assert exit_code == code
    assert seconds < 1.0 * patience()
    places = [up.where(name, "bye") for name in names]
    assert places == sorted(places)
    assert not any(alive(up.pid(name)) for name in names)


def test_a_node_deaf_to_sigterm_is_killed_after_its_grace_and_holds_up_no_other(
    supervise: Start,
) -> None:
    up = supervise(("source", "good"), ("plot", "deaf"), ("sink", "good"), grace=1.0)
    up.wait("lodeline", "released")
    code, seconds = stopped_in(up, signal.SIGTERM)
    assert code == 0
    assert 1.0 <= seconds < 1.7 * patience()
    assert up.where("sink", "bye") < up.where("lodeline", "KILLED plot: still there 1 s")
    assert up.report()["plot"]["last_exit"] == "SIGKILL"


def test_a_second_interrupt_kills_at_once(supervise: Start) -> None:
    up = supervise(("plot", "deaf"), ("sink", "good"), grace=5.0)
    up.wait("lodeline", "released")
    up.signal(signal.SIGINT)
    up.wait("sink", "bye")
    code, seconds = stopped_in(up, signal.SIGINT)
    assert code == 130
    assert seconds < 0.7 * patience()
    assert not alive(up.pid("plot"))


def test_a_stopped_node_is_woken_up_to_end_well(supervise: Start) -> None:
    up = supervise(("sink", "good"))
    up.wait("lodeline", "released")
    os.kill(up.pid("sink"), signal.SIGSTOP)
    code, seconds = stopped_in(up, signal.SIGTERM)
    assert code == 0
    assert seconds < 1.0 * patience()
    assert up.said("sink", "bye")


def test_a_run_of_so_many_seconds_ends_by_itself(supervise: Start) -> None:
    up = supervise(("source", "good"), seconds=0.5)
    up.wait("lodeline", "released")
    began = time.monotonic()
    assert up.end() == 0
    assert 0.4 < time.monotonic() - began < 1.5 * patience()


def test_a_host_without_nodes_stays_up_and_stops_as_others_do(supervise: Start) -> None:
    up = supervise()
    up.wait("lodeline", "released")
    code, seconds = stopped_in(up, signal.SIGINT)
    assert code == 130
    assert seconds < 1.0 * patience()
    assert not any("Traceback" in text for _, text in up.lines)


def test_a_node_waiting_for_its_restart_does_not_hold_up_the_stop(supervise: Start) -> None:
    up = supervise(("bad", "crash"), ("sink", "good"), backoff={"first": 5.0})
    up.wait("lodeline", "NODE_EXIT bad")
    up.wait("sink", "launch")
    code, seconds = stopped_in(up, signal.SIGTERM)
    assert code == 0
    assert seconds < 1.0 * patience()
    assert up.starts("bad") == 1
