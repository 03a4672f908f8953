"""Rates, bandwidths and ages of keys, from the counters that nodes publish about themselves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from lodeline.run_folder import Manifest
from lodeline.tables import table
from lodeline_msgs import NodeStatus

Row = dict[str, Any]


def traffic(
    manifest: Manifest,
    statuses: Mapping[str, NodeStatus],
    key: str,
    bars: Mapping[frozenset[str], float] = MappingProxyType({}),
) -> Row:
    """What is known of a full key: rate [Hz] and bandwidth [B/s] at its sender; at each reader
    ages [s] of the last second, and samples received, lost and late since it started.

    A reader that gets the samples from its own process, by direct calls, has None for all. Ages
    have an `age_error` [s], from the `bars` between the clocks of two hosts: None if it is unknown.
    """
    node = manifest.keys[key].node
    source = statuses.get(node or "")
    rate = None if source is None else source.rates.get(key)
    return {
        "key": key.removeprefix(f"{manifest.name}/"),
        "node": node,
        "rate": rate,
        "bandwidth": None if source is None else source.bandwidths.get(key),
        "to": {
            reader.node: _at_reader(statuses.get(reader.node), key)
            | {"age_error": _age_error(manifest.places, node, reader.node, bars)}
            for reader in manifest.readers.get(key, ())
        },
    }


def _at_reader(status: NodeStatus | None, key: str) -> Row:
    counted = status is not None and key in status.received
    return {
        "age_p50": status.age_p50.get(key) if status else None,
        "age_p99": status.age_p99.get(key) if status else None,
        "received": status.received[key] if status and counted else None,
        "lost": status.lost[key] if status and counted else None,
        "late": status.late[key] if status and counted else None,
    }


def _age_error(
    places: Mapping[str, str], source: str | None, reader: str, bars: Mapping[frozenset[str], float]
) -> float | None:
    there, here = places.get(source or ""), places.get(reader)
    return 0.0 if there == here or there is None else bars.get(frozenset((there, here or "")))


def hz_table(rows: Iterable[Row]) -> str:
    """Rates, and how the samples fare at each reader."""
    headings = ("KEY", "HZ", "READ BY", "AGE P50", "P99", "LOST", "LATE")
    cells = [
        (
            *_once(first, row["key"], number(row["rate"])),
            node,
            _age(seen, "age_p50"),
            _age(seen, "age_p99"),
            *_counts(seen),
        )
        for row in rows
        for first, node, seen in _readers(row)
    ]
    return table(headings, cells, right=("HZ", *headings[3:]))


def bw_table(rows: Iterable[Row]) -> str:
    """Bandwidths; a key that nobody listens to is not even packed and costs none."""
    headings = ("KEY", "FROM", "HZ", "KB/S", "BYTES EACH")
    cells = [
        (
            row["key"],
            _node(row),
            number(row["rate"]),
            number(None if row["bandwidth"] is None else row["bandwidth"] / 1e3, 2),
            number(_each(row), 0),
        )
        for row in rows
    ]
    return table(headings, cells, right=headings[2:])


def delay_table(rows: Iterable[Row]) -> str:
    """Ages on arrival at each reader: since the sensor was read, not since the last hop."""
    headings = ("KEY", "READ BY", "AGE P50", "P99", "LATE")
    cells = [
        (
            *_once(first, row["key"]),
            node,
            _age(seen, "age_p50"),
            _age(seen, "age_p99"),
            _counts(seen)[1],
        )
        for row in rows
        for first, node, seen in _readers(row)
    ]
    return table(headings, cells, right=headings[2:])


def number(value: float | None, digits: int = 1) -> str:
    """A number, or `-` for what is not known."""
    return "-" if value is None else f"{value:.{digits}f}"


def milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.2f} ms"


def _age(seen: Row, name: str) -> str:
    """An age, with its bar if it is of two clocks; doubtful if there is none."""
    age, error = seen[name], seen["age_error"]
    if age is None or error == 0.0:
        return milliseconds(age)
    return (
        f"({milliseconds(age)} ?)" if error is None else f"{milliseconds(age)} +-{error * 1e3:.1f}"
    )


def _readers(row: Row) -> list[tuple[bool, str, Row]]:
    """(whether it is the first, its name, what it saw) of each reader, `-` if there is none."""
    nobody: Row = {"age_p50": None, "age_p99": None, "lost": None, "late": None}
    nobody["age_error"] = 0.0
    readers = row["to"] or {"-": nobody}
    return [(place == 0, node, seen) for place, (node, seen) in enumerate(readers.items())]


def _once(first: bool, *cells: str) -> tuple[str, ...]:
    return cells if first else ("",) * len(cells)


def _node(row: Row) -> str:
    return row["node"] or "(outside)"


def _counts(seen: Row) -> tuple[str, str]:
    lost, late = ("-" if seen[name] is None else str(seen[name]) for name in ("lost", "late"))
    return lost, late


def _each(row: Row) -> float | None:
    return row["bandwidth"] / row["rate"] if row["bandwidth"] and row["rate"] else None
