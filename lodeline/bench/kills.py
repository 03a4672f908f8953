"""Each node of a running pipeline killed many times, one after the other: how soon it is back."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass, field

from lodeline.bench.rig import Rig
from lodeline.tables import table

ROUND_S = 13.0
"""From kill to kill of one node: so long that its supervisor neither holds it back nor gives up."""
PATIENCE_S = 10.0


@dataclass(slots=True)
class Kills:
    """Times [s] from the kills of a node to the line on the log, and to samples on all its keys.

    `others` counts the processes that were not left alone meanwhile.
    """

    seen: list[float] = field(default_factory=list)
    back: list[float] = field(default_factory=list)
    others: int = 0


def kill_all(rig: Rig, times: int) -> dict[str, Kills]:
    """Kill each node so many times, all of them once in a round."""
    keys: dict[str, list[str]] = {}
    for key, known in rig.running.keys().items():
        if known.node is not None:
            keys.setdefault(known.node, []).append(key)
    found = {node: Kills() for node in keys}
    for _ in range(times):
        for node, kills in found.items():
            began = time.monotonic()
            _kill(rig, node, keys[node], kills)
            time.sleep(max(0.0, began + ROUND_S / len(found) - time.monotonic()))
    return found


def _kill(rig: Rig, node: str, keys: list[str], kills: Kills) -> None:
    before = rig.processes()
    began = time.monotonic()
    os.kill(int(before[node]["pid"]), signal.SIGKILL)
    time.sleep(0.02)  # what was under way has come in
    heard = {key: rig.count(key) for key in keys}
    if rig.until(lambda: all(rig.count(key) > heard[key] for key in keys), PATIENCE_S):
        kills.back.append(time.monotonic() - began)
    lines = [when for when, text in list(rig.log) if when >= began and f"NODE_EXIT {node}:" in text]
    kills.seen += [when - began for when in lines[:1]]
    kills.others += sum(
        each["pid"] != before[name]["pid"] for name, each in rig.processes().items() if name != node
    )


def report(found: dict[str, Kills], times: int) -> str:
    """One row for each node."""
    headings = ("NODE", "KILLS", "SEEN P50", "MAX", "BACK P50", "MAX", "TIMES", "OTHERS HIT")
    rows = []
    for node, each in found.items():
        counts = str(len(each.back)), str(each.others)
        rows.append((node, str(times), *_words(each.seen), *_words(each.back), *counts))
    return table(headings, rows, right=headings[1:])


def _words(values: list[float]) -> tuple[str, str]:
    ranked = sorted(values)
    return (f"{ranked[len(ranked) // 2]:.2f} s", f"{ranked[-1]:.2f} s") if ranked else ("-", "-")


def all_held(found: dict[str, Kills], times: int) -> bool:
    """Whether each was back each time, and no other process was hit."""
    return all(len(kills.back) == times and not kills.others for kills in found.values())
