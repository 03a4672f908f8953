"""Claims about the benches of speed: each runs, and counts what it says it counts.

No figure of time is held against a bound here: the machine that runs tests has other things to do.
"""

from __future__ import annotations

import json
import os
import threading
import time
from typing import Any

import pytest

from lodeline.bench.family import cpu_seconds
from lodeline.bench.start import _lost, _recovered
from lodeline.cli import main


def bench(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main(["bench", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_latency_of_all_layouts_and_baselines(capsys: pytest.CaptureFixture[str]) -> None:
    chains = ("raw", "tuned", "grouped", "calls", "together")
    rates = ("--rates", "100", "--seconds", "0.5")
    costs = bench(capsys, "latency", *rates, "--chains", *chains)["100"]
    assert set(costs) == set(chains)
    for cost in costs.values():
        assert 0.0 < cost["p50"] <= cost["p99"] <= cost["p999"] < 1e6
        assert cost["samples"] > 25
        assert cost["cpu"] > 0.0
        assert 20e6 < cost["rss"] < 45e6  # Python with zenoh, and no numpy
        # what is shared counts once, within the chain and with others of this machine; but every
        # stage has 5 MB and more of its own (the guard has less)
        assert 5e6 * (cost["processes"] - 1) < cost["pss"] < 0.8 * cost["processes"] * cost["rss"]
    assert costs["together"]["pss"] < costs["raw"]["pss"]
    assert costs["raw"]["processes"] == 7
    assert costs["together"]["processes"] == 4  # supervisor, guard, the chain, the subscriber
    assert costs["calls"]["calls"] < costs["calls"]["p50"]


def test_scale_counts_subscribers_and_robots(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--subscribers", "2", "--robots", "1", "--seconds", "1.2")
    found = bench(capsys, "scale", *words)
    (heard,), (robots,) = found["subscribers"], found["robots"]
    assert 0.8 < heard["came"] < 1.2
    assert 0.0 < heard["p50"] <= heard["p99"]
    assert 50.0 < robots["pose"] < 150.0
    assert robots["pss"] > 20e6


def test_throughput_finds_a_rate_and_a_speed(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--seconds", "0.5", "--most", "500", "--recording", "2")
    found = bench(capsys, "throughput", *words)
    assert set(found["chain"].values()) <= {0, 500}
    assert 0 < found["record"] <= 510
    assert found["replay"] > 0.0
    assert 1.0 < found["replayed"] < 3.0


def test_memory_of_both_layouts(capsys: pytest.CaptureFixture[str]) -> None:
    found = bench(capsys, "memory", "--seconds", "0.5")
    apart, together = found["a process for each node"], found["one process"]
    assert {"imu", "ekf", "(supervisor)", "(guard)"} <= set(apart)
    assert len(together) == 3
    assert sum(part["pss"] for part in together.values()) < sum(
        part["pss"] for part in apart.values()
    )


def test_start_loses_nothing_and_times_every_restart(capsys: pytest.CaptureFixture[str]) -> None:
    (run,) = bench(capsys, "start", "--rounds", "1", "--idle", "0.2")["warm"]
    assert run["lost"] == 0
    assert len(run["restarts"]) == 3
    assert run["first_pose"] > 0.0
    assert set(run["verbs"]) == {"check", "topic list"}


def test_what_a_thread_took_of_the_processor_counts_after_its_end() -> None:
    me = os.getpid()
    before, own = cpu_seconds(me), time.process_time()
    thread = threading.Thread(target=lambda: sum(range(2_000_000)))
    thread.start()
    thread.join()
    took = time.process_time() - own
    assert took > 1e-3
    assert took <= cpu_seconds(me) - before < took + 0.01


def test_a_number_that_is_missing_at_the_start_is_lost() -> None:
    assert _lost([(2, 10), (3, 20), (5, 30)], until=100) == 3
    assert _lost([(0, 10), (1, 20), (9, 150)], until=100) == 0


def test_a_restart_ends_with_the_first_sample_that_is_counted_anew() -> None:
    samples = [(7, 100), (8, 200), (9, 310), (0, 1_000_000_300), (1, 2_000_000_300)]
    assert _recovered(samples, killed=300) == pytest.approx(1.0)
