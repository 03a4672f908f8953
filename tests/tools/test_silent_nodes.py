"""Claims about a node that says nothing any more: what it said last is not told as of now."""

from __future__ import annotations

from dataclasses import replace

from lodeline.dash.scene import status_of
from lodeline.run_folder import Key, Manifest
from lodeline.terminal.health import health, health_table
from lodeline.watch import SILENT_S
from lodeline_msgs import NodeStatus

STATUS = NodeStatus(
    stamp=1,
    node="odometry",
    host="robot",
    state="running",
    pid=7,
    pipeline="d",
    rates={"rover/odom": 100.0},
    bandwidths={"rover/odom": 0.0},
    age_p50={"rover/wheels": 0.002},
    age_p99={"rover/wheels": 0.004},
    received={"rover/wheels": 900},
    lost={"rover/wheels": 3},
    late={"rover/wheels": 1},
    rejected={},
    restarts=0,
    cpu=0.04,
    rss=30 << 20,
    last_error="",
    jitter=0.001,
)
MANIFEST = Manifest(
    name="rover",
    hosts=("robot",),
    pid=1,
    started=0.0,
    file="p.yaml",
    digest="d",
    clock="host",
    keys={"rover/odom": Key("Odometry", "odometry")},
    nodes={"odometry": "odometry"},
)


def test_the_page_gets_counts_of_a_silent_node_but_no_rate_age_or_load() -> None:
    speaks, silent = (status_of(STATUS, "rover/", age) for age in (0.5, SILENT_S + 0.1))
    assert speaks["rates"] == {"odom": 100.0}
    assert speaks["age_p99"] == {"wheels": 0.004}
    assert (silent["rates"], silent["age_p50"], silent["cpu"]) == ({"odom": 0.0}, {}, 0.0)
    assert silent["lost"] == speaks["lost"] == {"wheels": 3}


def test_top_shows_dashes_for_what_a_silent_node_does_now() -> None:
    statuses = {"odometry": STATUS}
    (speaks,) = health(MANIFEST, statuses, {"odometry": 0.5}, {})
    (silent,) = health(MANIFEST, statuses, {"odometry": SILENT_S + 0.1}, {})
    assert (speaks["rates"], speaks["cpu"], speaks["state"]) == ({"odom": 100.0}, 0.04, "running")
    assert (silent["rates"], silent["age_p99"], silent["cpu"]) == ({}, None, None)
    assert (silent["state"], silent["lost"], silent["late"]) == ("silent", 3, 1)
    assert "100" not in health_table([silent])


def test_ticks_that_a_driver_missed_or_was_late_for_are_no_refusals() -> None:
    refused = {"missed tick": 2, "late tick": 60, "overflow": 1}
    status = replace(STATUS, lost={}, late={}, rejected=refused)
    (row,) = health(MANIFEST, {"odometry": status}, {"odometry": 0.5}, {})
    assert (row["lost"], row["late"], row["rejected"]) == (2, 60, 1)
    assert status.rejected == refused
