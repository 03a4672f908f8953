"""Claims about what is left when the supervisor itself is killed: nothing."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

from lodeline.supervisor.groups import GUARD
from tests.supervisor.talk import Start, Talk, alive, patience, until

LIMIT_S = 0.5


def family(up: Talk) -> list[int]:
    """All processes of a supervisor with the nodes `tree` and `still`."""
    helpers = map(int, up.wait("tree", r"helpers (\d+) (\d+) (\d+) (\d+)").groups())
    up.wait("lodeline", "released")
    return [up.pid("tree"), up.pid("still"), *helpers]


def guard_of(up: Talk) -> int:
    until(lambda: up.guard is not None, 5.0)
    assert up.guard is not None
    return up.guard


@pytest.mark.parametrize("run", range(3))
def test_nothing_survives_a_killed_supervisor(supervise: Start, run: int) -> None:
    up = supervise(("tree", "tree"), ("still", "good"))
    pids = [*family(up), guard_of(up)]
    os.kill(up.pid("still"), signal.SIGSTOP)
    assert all(alive(pid) for pid in pids)
    up.signal(signal.SIGKILL)
    assert until(lambda: not any(map(alive, pids)), 10.0) < LIMIT_S * patience()


def test_a_killed_guard_has_a_successor_that_knows_all(supervise: Start) -> None:
    up = supervise(("tree", "tree"), ("still", "good"))
    pids = family(up)
    first = guard_of(up)
    os.kill(first, signal.SIGKILL)
    up.wait("lodeline", "GUARD_EXIT -9: started again")
    until(lambda: up.guard not in (None, first), 3.0)
    successor = guard_of(up)
    up.signal(signal.SIGKILL)
    until(lambda: not any(alive(pid) for pid in [*pids, successor]), LIMIT_S)
    assert up.end() == -signal.SIGKILL


def test_when_guard_and_supervisor_die_together_the_next_start_clears_up(
    supervise: Start, run_base: Path
) -> None:
    up = supervise(("tree", "tree"), ("still", "good"))
    pids = family(up)
    # The guard first, but the supervisor before it can have another.
    guard = guard_of(up)
    up.signal(signal.SIGSTOP)
    os.kill(guard, signal.SIGKILL)
    up.signal(signal.SIGKILL)
    up.end()
    until(lambda: not any(map(alive, pids[:2])), LIMIT_S)  # the kernel sees to the nodes,
    helpers = pids[2:]
    assert all(map(alive, helpers))  # but not to what they started
    socket = run_base / "fakes" / "robot" / "notify0"
    assert socket.exists()
    successor = supervise(("sink", "good"))
    left = successor.wait("lodeline", r"leftovers \[(.*)\]")[1].split(", ")
    bare = pids[-1]
    os.kill(bare, signal.SIGKILL)  # what sheds our marks and loses its guard is not promised
    assert {int(pid) for pid in left} >= set(helpers) - {bare}
    until(lambda: not any(alive(pid) for pid in pids), LIMIT_S)
    successor.wait("lodeline", "released")


def test_a_helper_in_a_session_of_its_own_is_gone_after_a_normal_stop(supervise: Start) -> None:
    up = supervise(("tree", "tree"), ("still", "good"))
    pids = family(up)
    up.signal(signal.SIGTERM)
    assert up.end() == 0
    until(lambda: not any(alive(pid) for pid in pids), LIMIT_S)


def test_the_guard_kills_the_groups_it_knows_and_then_becomes_the_sweep() -> None:
    sleep = ["sleep", "60"]
    known, forgotten, other = (subprocess.Popen(sleep, start_new_session=True) for _ in range(3))
    try:
        lines = f"+{known.pid}\n+{forgotten.pid}\n-{forgotten.pid}\n-{other.pid}\n"
        done = subprocess.run(
            ["/bin/sh", GUARD, "echo", "sweep of", "a mark"],
            input=lines,
            capture_output=True,
            text=True,
            timeout=10.0,
        )
        assert done.stdout == "sweep of a mark\n"
        assert known.wait(5.0) == -signal.SIGKILL
        assert forgotten.poll() is None
        assert other.poll() is None
    finally:
        for process in (known, forgotten, other):
            process.kill()
            process.wait()
