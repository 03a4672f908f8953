"""Claims about when a process that died is started again."""

from __future__ import annotations

import random

import pytest

from lodeline.supervisor.backoff import Backoff, BackoffParams
from lodeline.supervisor.environment import environment

PARAMS = BackoffParams()


def middle(low: float, high: float) -> float:
    return (low + high) / 2.0


def test_delays_double_up_to_five_seconds() -> None:
    backoff = Backoff("always", PARAMS, middle)
    delays = [backoff.after_exit(10.0 * i, 0.0) for i in range(9)]
    assert delays == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0, 5.0])


def test_a_process_that_was_ready_for_ten_seconds_starts_over_at_once() -> None:
    backoff = Backoff("always", PARAMS, middle)
    for i in range(4):
        backoff.after_exit(float(i), 9.9)
    assert backoff.after_exit(20.0, 10.0) == 0.0
    assert backoff.after_exit(21.0, 0.5) == pytest.approx(0.1)


def test_five_restarts_within_a_minute_are_enough_for_a_limited_process() -> None:
    backoff = Backoff("limited", PARAMS, middle)
    assert all(backoff.after_exit(11.9 * i, 11.0) is not None for i in range(5))
    assert backoff.after_exit(59.9, 11.0) is None


def test_a_limited_process_that_dies_seldom_goes_on_for_ever() -> None:
    backoff = Backoff("limited", PARAMS, middle)
    assert all(backoff.after_exit(12.1 * i, 11.0) is not None for i in range(50))


def test_a_process_that_is_never_restarted_is_not() -> None:
    assert Backoff("never", PARAMS, middle).after_exit(0.0, 100.0) is None


def test_jitter_keeps_delays_within_a_fifth() -> None:
    draw = random.Random(1)
    delays = []
    for _ in range(200):
        delay = Backoff("always", PARAMS, draw.uniform).after_exit(0.0, 0.0)
        assert delay is not None
        delays.append(delay)
    assert 0.08 <= min(delays) < 0.085
    assert 0.115 < max(delays) <= 0.12


def test_the_environment_of_nodes_is_an_allow_list() -> None:
    parent = {"PATH": "/bin", "LC_ALL": "C", "LODELINE_RUN": "/r", "AWS_SECRET": "x", "LCX": "y"}
    assert environment(parent) == {
        "PATH": "/bin",
        "LC_ALL": "C",
        "LODELINE_RUN": "/r",
        "PYTHONFAULTHANDLER": "1",
        "PYTHONUNBUFFERED": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MALLOC_ARENA_MAX": "1",
        "MALLOC_MMAP_THRESHOLD_": "65536",
    }
