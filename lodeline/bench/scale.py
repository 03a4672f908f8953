"""How cost grows: subscribers of one pose, and simulated robots on one machine.

Subscribers are tools: each has its own line to the hub, which copies the pose for it. Robots are
the default pipeline, every robot in one process; `pose` is what rate of 100 Hz each still had.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from statistics import mean
from typing import Annotated

from lodeline.bench.chain.runs import HERE, PIPELINE
from lodeline.bench.family import cpu_seconds, family, memory
from lodeline.bench.memory import in_one_process
from lodeline.bench.up import Up
from lodeline.loading import shipped
from lodeline.tables import table
from lodeline.terminal.numbers import count, positive
from lodeline.watch import Watch

EXIT_FAILED = 1
RATE = 50.0
SETTLE_S = 1.5
MIB = 1 << 20


@dataclass(frozen=True, slots=True)
class Heard:
    """So many subscribers: ages [s], what of the poses due came, and parts of a core used."""

    subscribers: int
    p50: Annotated[float, "s"]
    p99: Annotated[float, "s"]
    came: float
    node: Annotated[float, "1"]
    hub: Annotated[float, "1"]


@dataclass(frozen=True, slots=True)
class Robots:
    """So many robots: part of a core for each, memory of each, and the poses they still made."""

    robots: int
    cpu: Annotated[float, "1"]
    pss: Annotated[float, "B"]
    pose: Annotated[float, "Hz"]


def main(argv: list[str]) -> int:
    """Run `lodeline bench scale`; the exit code."""
    arguments = parser().parse_args(argv)
    try:
        heard = [subscribers(count, arguments.seconds) for count in arguments.subscribers]
        fleet = [robots(count, arguments.seconds) for count in arguments.robots]
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    if arguments.json:
        plain = {"subscribers": list(map(asdict, heard)), "robots": list(map(asdict, fleet))}
        print(json.dumps(plain))
    else:
        print(shown(heard, fleet))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench scale` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench scale", description=__doc__)
    counts = [1, 4, 16, 64]
    parser.add_argument("--subscribers", type=count, nargs="+", default=counts, metavar="N")
    parser.add_argument("--robots", type=count, nargs="+", default=[1, 2, 4, 8, 16], metavar="N")
    parser.add_argument("--seconds", type=positive, default=4.0, help="of each (default: 4)")
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def subscribers(count: int, seconds: float) -> Heard:
    """What so many subscribers of a pose at 50 Hz hear and cost."""
    text = PIPELINE.format(
        here=HERE / "nodes",
        nodes=shipped("nodes"),
        rate=RATE,
        folder='"{folder}"',
        one="process: all,",
        estimation="process: all,",
    )
    with Up(text) as up:
        with Watch(up.running) as watch:
            node = watch.processes()["ekf"]["pid"]
        command = [sys.executable, "-P", str(HERE / "subscribers.py"), str(up.folder / "run")]
        with subprocess.Popen(
            [*command, str(count), f"{seconds:g}"], stdout=subprocess.PIPE, text=True
        ) as listeners:
            assert listeners.stdout is not None
            listeners.stdout.readline()
            pids = (node, up.process.pid)
            before, since = [cpu_seconds(pid) for pid in pids], time.monotonic()
            line = listeners.stdout.readline()
            elapsed = time.monotonic() - since
            used = [cpu_seconds(pid) - was for pid, was in zip(pids, before, strict=True)]
        if not line:
            raise RuntimeError(f"{count} subscribers: they failed")
        came, p50, p99 = json.loads(line)
    due = count * RATE * seconds
    return Heard(count, p50, p99, came / due, used[0] / elapsed, used[1] / elapsed)


def robots(count: int, seconds: float) -> Robots:
    """What so many simulated robots cost, and whether they keep up."""
    text = in_one_process(shipped("pipeline.yaml").read_text())
    with ExitStack() as stack:
        ups = [
            stack.enter_context(Up(text.replace("name: rover", f"name: rover{number}")))
            for number in range(count)
        ]
        time.sleep(SETTLE_S)
        pids = family(up.process.pid for up in ups)
        before, since = sum(map(cpu_seconds, pids)), time.monotonic()
        time.sleep(seconds)
        used = (sum(map(cpu_seconds, pids)) - before) / (time.monotonic() - since)
        held = sum(memory(pid).pss for pid in pids)
        rates = []
        for up in ups:
            with Watch(up.running) as watch:
                statuses = watch.statuses(10.0)
                rates += [rate for status in statuses.values() for rate in _poses(status.rates)]
    return Robots(count, used / count, held / count, mean(rates) if rates else 0.0)


def _poses(rates: dict[str, float]) -> list[float]:
    return [rate for key, rate in rates.items() if key.endswith("/pose")]


def shown(heard: list[Heard], fleet: list[Robots]) -> str:
    """Two tables, and what one more costs."""
    rows = [
        [
            str(each.subscribers),
            f"{each.p50 * 1e3:.2f}",
            f"{each.p99 * 1e3:.2f}",
            f"{100.0 * each.came:.1f}",
            f"{100.0 * each.node:.1f}",
            f"{100.0 * each.hub:.1f}",
        ]
        for each in heard
    ]
    headings = [
        "subscribers",
        "p50 ms",
        "p99 ms",
        "came %",
        "node, % of a core",
        "hub, % of a core",
    ]
    lines = [table(headings, rows, headings)]
    if len(heard) > 1:
        first, last = heard[0], heard[-1]
        more = (last.hub - first.hub) / (last.subscribers - first.subscribers)
        lines.append(f"one more costs the hub {more / RATE * 1e6:.0f} us of CPU for each pose")
    rows = [
        [
            str(each.robots),
            f"{100.0 * each.cpu:.1f}",
            f"{each.pss / MIB:.1f}",
            f"{each.pose:.1f}",
        ]
        for each in fleet
    ]
    headings = ["robots", "% of a core each", "PSS MiB each", "pose Hz"]
    return "\n".join([*lines, "", table(headings, rows, headings)])
