"""How the nodes of a pipeline fare: one row each, from their status and their supervisor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lodeline.run_folder import Manifest
from lodeline.tables import table
from lodeline.terminal.traffic import milliseconds
from lodeline.watch import SILENT_S, parted
from lodeline_msgs import NodeStatus

Row = dict[str, Any]

HEADINGS = (
    *("NODE", "HOST", "STATE", "HZ OUT", "AGE IN P50", "P99", "LOST", "LATE", "REJ"),
    *("JITTER", "CPU", "RSS", "RESTARTS", "LAST ERROR"),
)
RIGHT = HEADINGS[3:-1]
_COUNTERS = ("lost", "late", "rejected")


def health(
    manifest: Manifest,
    statuses: Mapping[str, NodeStatus],
    silence: Mapping[str, float],
    processes: Mapping[str, Mapping[str, Any]],
) -> list[Row]:
    """Rows by node: rates [Hz] by key; the oldest ages [s] of its inputs; losses of all of them.

    `silence` [s] is how long ago each status came, `processes` what the supervisors say. Of a node
    that is silent there is what it counted before.
    """
    rows = []
    for node in manifest.nodes:
        status, process = statuses.get(node), processes.get(node, {})
        now = None if silence.get(node, 0.0) > SILENT_S else status
        rows.append(
            {
                "node": node,
                "host": process.get("host", status.host if status else manifest.host),
                "state": _state(status, silence.get(node, 0.0), process.get("state")),
                "rates": _rates(manifest, now),
                "age_p50": max(now.age_p50.values(), default=None) if now else None,
                "age_p99": max(now.age_p99.values(), default=None) if now else None,
                **_losses(status),
                "jitter": now.jitter if now else None,
                "cpu": now.cpu if now else None,
                "rss": status.rss if status else None,
                "restarts": process.get("restarts", status.restarts if status else None),
                "last_error": status.last_error if status else "",
            }
        )
    return rows


def _losses(status: NodeStatus | None) -> dict[str, int | None]:
    """What a node did not use; ticks that a driver missed or was late for are no refusals."""
    if status is None:
        return dict.fromkeys(_COUNTERS)
    ticks, rejected = parted(status)
    return {
        "lost": sum(status.lost.values()) + ticks["missed tick"],
        "late": sum(status.late.values()) + ticks["late tick"],
        "rejected": sum(rejected.values()),
    }


def _state(status: NodeStatus | None, silence: float, process: str | None) -> str:
    """The supervisor knows whether it lives, the node itself whether it works."""
    if process is not None and process != "running":
        return process
    if status is None or silence > SILENT_S:
        return "silent"
    return status.state


def _rates(manifest: Manifest, status: NodeStatus | None) -> dict[str, float]:
    if status is None:
        return {}
    prefix = f"{manifest.name}/"
    return {key.removeprefix(prefix): rate for key, rate in status.rates.items()}


def health_table(rows: Iterable[Row]) -> str:
    """The rows for people."""
    cells = [
        (
            row["node"],
            row["host"],
            row["state"],
            "+".join(f"{rate:.0f}" for rate in row["rates"].values()) or "-",
            milliseconds(row["age_p50"]),
            milliseconds(row["age_p99"]),
            *("-" if row[name] is None else str(row[name]) for name in _COUNTERS),
            milliseconds(row["jitter"] or None),
            "-" if row["cpu"] is None else f"{row['cpu']:.1%}",
            "-" if row["rss"] is None else f"{row['rss'] / 2**20:.0f} MB",
            "-" if row["restarts"] is None else str(row["restarts"]),
            row["last_error"],
        )
        for row in rows
    ]
    return table(HEADINGS, cells, right=RIGHT)
