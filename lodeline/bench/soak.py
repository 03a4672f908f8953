"""A long run in which a random node is killed every few seconds: what is lost, what leaks.

One half of the nodes is killed in the first half of the time, the other in the second, so that
each also lives long beside neighbours that die. Of every node: kills, how soon its samples were
back, and how its memory grew within each life of three minutes or more, after its first two. Of
the pose: its distance from the truth, more than three seconds away from any kill; where it calls
itself ambiguous it may be wrong, and it has to have a reason to: a gap that nobody measured and
that odometry announced. After one it stays ambiguous, for magnets lie the same in every cell.
Exit codes: 0 every bound was held, 1 one was not, 2 usage.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import signal
import sys
import time
from dataclasses import dataclass, field

from lodeline.bench.rig import Rig, position_errors
from lodeline.tables import table

FIRST_KILL_S = 10.0
WARM_UP_S = 120.0
"""Memory for a neighbour's links is taken anew for the first twenty that come, and reused then."""
SHORTEST_LIFE_S = 180.0
AFTERMATH_S = 3.0
PATIENCE_S = 15.0
MOST_KILLS, WINDOW_S = 4, 60.0
"""One kill more in a minute, and the supervisor would rightly give a node up."""
SLOPE, ERROR_M = 0.01, 0.03
LEAST_DOUBT = 0.01
"""Share of the time that a pose may call itself ambiguous while nothing is amiss: in a bend without
magnets, say.
"""


@dataclass
class Record:
    """What was seen of one node. `memory` holds (time [s], bytes) of each life by its pid."""

    kills: list[float] = field(default_factory=list)
    back: list[float] = field(default_factory=list)
    memory: dict[int, list[tuple[float, int]]] = field(default_factory=dict)


def main(argv: list[str]) -> int:
    """Run `lodeline bench soak`; the exit code."""
    arguments = parser().parse_args(argv)
    with Rig(arguments.file) as rig:
        began = time.monotonic()
        records = soak(
            rig, arguments.minutes * 60.0, arguments.every, random.Random(arguments.seed)
        )
        states = {name: process["state"] for name, process in rig.processes().items()}
    kills = sorted(when for record in records.values() for when in record.kills)
    print(f"{arguments.minutes:g} min, {len(kills)} kills, seed {arguments.seed}")
    print(report(records, states))
    doubted = {when for when, pose in rig.poses if pose.ambiguous}
    print(f"pose: {len(doubted) / max(1, len(rig.poses)):.1%} of the time ambiguous")
    if rig.gaps:
        since = rig.gaps[0] - began
        print(f"pose: {len(rig.gaps)} gaps that nobody measured, from {since:.0f} s on")
    calm = calm_poses(position_errors(rig.poses, rig.truths), doubted, kills, rig.gaps)
    return verdict(records, states, calm)


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench soak` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench soak",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", nargs="?", default="pipeline.yaml", help="a simulated pipeline")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--every", type=float, default=5.0, help="s between kills, 0: none")
    parser.add_argument("--seed", type=int, default=1)
    return parser


def soak(rig: Rig, seconds: float, every: float, draw: random.Random) -> dict[str, Record]:
    """Kill and look, once a second, until the time is over."""
    nodes = rig.running.manifest.nodes
    outputs = {
        node: [key for key, known in rig.running.keys().items() if known.node == node]
        for node in nodes
    }
    records = {node: Record() for node in [*nodes, "supervisor"]}
    order = draw.sample([*nodes], len(nodes))
    halves = order[: len(order) // 2], order[len(order) // 2 :]
    end = time.monotonic() + seconds
    due = time.monotonic() + max(every, FIRST_KILL_S)
    while (now := time.monotonic()) < end and not rig.ended:
        for node, status in rig.statuses().items():
            records[node].memory.setdefault(status.pid, []).append((now, status.rss))
        records["supervisor"].memory.setdefault(0, []).append((now, _rss(rig.supervisor.pid)))
        if every and now >= due:
            due += every
            half = halves[now > end - seconds / 2.0]
            recent = {
                node: sum(now - when < WINDOW_S for when in records[node].kills) for node in half
            }
            if patient := [node for node in half if recent[node] < MOST_KILLS]:
                node = draw.choice(patient)
                _kill(rig, node, outputs[node], records[node])
        time.sleep(max(0.0, now + 1.0 - time.monotonic()))
    return records


def _kill(rig: Rig, node: str, keys: list[str], record: Record) -> None:
    pid = rig.processes()[node]["pid"]
    if pid is None:
        return
    now = time.monotonic()
    record.kills.append(now)
    os.kill(pid, signal.SIGKILL)
    time.sleep(0.05)  # what was under way has come in
    before = {key: rig.count(key) for key in keys}
    if rig.until(lambda: all(rig.count(key) > before[key] for key in keys), PATIENCE_S):
        record.back.append(time.monotonic() - now)


def _rss(pid: int) -> int:
    with open(f"/proc/{pid}/statm") as file:  # noqa: PTH123 - one small read
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def slope(record: Record) -> float | None:
    """Growth of memory per minute as a part of it, over all lives that were long enough."""
    grown = total = 0.0
    for life in record.memory.values():
        settled = [(when, size) for when, size in life if when - life[0][0] >= WARM_UP_S]
        if len(settled) > 2 and settled[-1][0] - life[0][0] >= SHORTEST_LIFE_S:
            (first, small), (last, large) = settled[0], settled[-1]
            grown += (large - small) / small
            total += last - first
    return grown / total * 60.0 if total else None


def report(records: dict[str, Record], states: dict[str, str]) -> str:
    """One row for each node, and one for the supervisor."""
    headings = ("NODE", "STATE", "KILLS", "BACK", "P50", "MAX", "RSS %/MIN")
    rows = []
    for node, record in records.items():
        back, grown = sorted(record.back), slope(record)
        rows.append(
            (
                node,
                states.get(node, "running" if node == "supervisor" else "-"),
                str(len(record.kills)),
                str(len(back)),
                f"{back[len(back) // 2]:.2f} s" if back else "-",
                f"{back[-1]:.2f} s" if back else "-",
                "-" if grown is None else f"{grown:.2%}",
            )
        )
    return table(headings, rows, right=headings[2:])


@dataclass(frozen=True, slots=True)
class CalmPoses:
    """Errors [m], sorted, of poses away from kills: of those that were sure, and of the others.

    `groundless` counts those that were not sure before any gap gave a reason.
    """

    sure: list[float]
    unsure: list[float]
    groundless: int


def calm_poses(
    errors: list[tuple[float, float]], doubted: set[float], kills: list[float], gaps: list[float]
) -> CalmPoses:
    """Sort (time [s], error [m]) of poses by whether they were `doubted`, itself a set of times."""
    calm = [
        (when, error)
        for when, error in errors
        if not any(0.0 <= when - kill <= AFTERMATH_S for kill in kills)
    ]
    gap = min(gaps, default=math.inf)
    return CalmPoses(
        sorted(error for when, error in calm if when not in doubted),
        sorted(error for when, error in calm if when in doubted),
        sum(when < gap for when, _ in calm if when in doubted),
    )


def verdict(records: dict[str, Record], states: dict[str, str], calm: CalmPoses) -> int:
    """Print how true the pose was, and what was not held; the exit code."""
    faults = [f"{node} is {state}" for node, state in states.items() if state != "running"]
    faults += [
        f"{node} was not back within {PATIENCE_S:g} s {len(record.kills) - len(record.back)} times"
        for node, record in records.items()
        if len(record.back) < len(record.kills)
    ]
    for node, record in records.items():
        grown = slope(record)
        if grown is not None and grown > SLOPE:
            faults.append(f"{node} grows by {grown:.2%} a minute")
    faults += _untrue(calm)
    for fault in faults:
        print(f"NOT HELD {fault}", file=sys.stderr)
    return 1 if faults else 0


def _untrue(calm: CalmPoses) -> list[str]:
    sure, unsure, faults = calm.sure, calm.unsure, []
    if unsure:
        middle, most = unsure[len(unsure) // 2], unsure[-1]
        print(f"pose while ambiguous: median {middle * 1e3:.1f} mm, max {most * 1e3:.1f} mm off")
    if calm.groundless > LEAST_DOUBT * (len(sure) + len(unsure)):
        faults.append(f"the pose was ambiguous {calm.groundless} times without a reason")
    if not sure:
        return [*faults, "there was no pose that was sure"]
    rms = (sum(error * error for error in sure) / len(sure)) ** 0.5
    part = sum(error <= ERROR_M for error in sure) / len(sure)
    print(
        f"pose: {len(sure)} sure samples away from kills, rms {rms * 1e3:.1f} mm, "
        f"max {sure[-1] * 1e3:.1f} mm, {part:.2%} within {ERROR_M * 1e3:g} mm"
    )
    if part < 0.99:
        faults.append(f"the pose was within {ERROR_M * 1e3:g} mm only {part:.2%} of the sure time")
    return faults
