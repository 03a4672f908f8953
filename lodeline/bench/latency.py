"""How old a pose is when a subscriber has it, and what that costs: ours, plain zenoh, dora.

A chain from an IMU's sample through calibrate, attitude, odometry and ekf to a subscriber, six
hops: (a) one process per node, (b) the nodes that estimate in one process, (c) all in one but the
subscriber. Beside it, in turns: as many processes that only unpack and repack a sample on plain
zenoh, as it comes and with our bus's settings; the computation as plain function calls and one hop
over zenoh; and dora-rs where it is installed. Figures are medians of the rounds; a ratio is the
median of the rounds' own, for what disturbs a round disturbs all chains of it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, fields
from statistics import median

from lodeline.bench.chain import runs
from lodeline.bench.chain.runs import Cost, Start, measure
from lodeline.tables import table
from lodeline.terminal.numbers import count, positive

EXIT_FAILED = 1
MIB = 1 << 20
CHAINS: dict[str, Start] = {
    "raw": runs.raw,
    "tuned": runs.raw_tuned,
    "apart": runs.apart,
    "grouped": runs.grouped,
    "calls": runs.calls,
    "together": runs.together,
    "dora": runs.dora,
}
TITLES = {
    "raw": "raw zenoh chain",
    "tuned": "raw zenoh, tuned",
    "apart": "(a) process per node",
    "grouped": "(b) estimation grouped",
    "calls": "function calls + a hop",
    "together": "(c) all in one",
    "dora": "dora-rs chain",
}
BASE = "raw"
RATIOS = ("p50", "p99", "cpu")
Results = dict[float, dict[str, list[Cost]]]
"""What each round found, by rate [Hz] and chain."""


def main(argv: list[str]) -> int:
    """Run `lodeline bench latency`; the exit code."""
    arguments = parser().parse_args(argv)
    # dora's runtime spins: under real-time priority it leaves the machine to nobody else.
    with_dora = runs.dora_command() is not None and arguments.priority is None
    chains = [name for name in arguments.chains if name != "dora" or with_dora]
    if arguments.priority is not None and (why := _take_priority(arguments.priority)):
        print(why, file=sys.stderr)
        return EXIT_FAILED
    try:
        results = run(chains, arguments.rates, arguments.seconds, arguments.rounds)
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    if arguments.json:
        plain = {
            f"{rate:g}": {
                name: asdict(middle(rounds)) | {"of_raw": _ratios(rounds, costs.get(BASE))}
                for name, rounds in costs.items()
            }
            for rate, costs in results.items()
        }
        print(json.dumps(plain))
    else:
        print(shown(results))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench latency` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench latency", description=__doc__)
    parser.add_argument(
        "--rates", type=float, nargs="+", default=[50.0, 200.0, 500.0, 1000.0], metavar="HZ"
    )
    parser.add_argument("--seconds", type=positive, default=1.5, help="of each (default: 1.5)")
    parser.add_argument("--rounds", type=count, default=3, help="(default: 3)")
    parser.add_argument("--chains", nargs="+", choices=CHAINS, default=list(CHAINS))
    parser.add_argument(
        "--priority",
        type=int,
        metavar="N",
        help="all chains under SCHED_FIFO N, so that other work disturbs none; without dora",
    )
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def run(chains: Sequence[str], rates: Sequence[float], seconds: float, rounds: int) -> Results:
    """Measure all chains in turns, every other round backwards."""
    found: Results = {rate: {name: [] for name in chains} for rate in rates}
    for number in range(rounds):
        for rate in rates:
            for name in chains if number % 2 == 0 else reversed(chains):
                found[rate][name].append(measure(CHAINS[name], rate, seconds))
    return found


def middle(costs: list[Cost]) -> Cost:
    """Medians of each figure; samples and losses are added up."""
    figures = {
        item.name: median(getattr(cost, item.name) for cost in costs) for item in fields(Cost)
    }
    figures["samples"] = sum(cost.samples for cost in costs)
    figures["lost"] = sum(cost.lost for cost in costs)
    return Cost(**figures)


def ratio(costs: list[Cost], base: list[Cost], figure: str) -> float:
    """How many times the base's a figure is, in the median of the rounds."""
    pairs = zip(costs, base, strict=True)
    found: list[float] = [getattr(mine, figure) / getattr(their, figure) for mine, their in pairs]
    return median(found)


def _ratios(costs: list[Cost], base: list[Cost] | None) -> dict[str, float]:
    return {} if base is None else {name: ratio(costs, base, name) for name in RATIOS}


def _take_priority(priority: int) -> str:
    """Have this process and its children run before all others; why not, if so."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return f"SCHED_FIFO {priority}: {error.strerror}"
    return ""


def shown(results: Results) -> str:
    """A table of all, and what of the raw chain each is."""
    rows = []
    for rate, costs in results.items():
        for name, rounds in costs.items():
            cost, ratios = middle(rounds), _ratios(rounds, costs.get(BASE))
            numbers = (cost.p50, cost.p99, cost.p999)
            rows.append(
                [
                    f"{rate:g}",
                    TITLES[name],
                    *(f"{number:.0f}" for number in numbers),
                    str(cost.lost),
                    f"{cost.cpu:.3f}",
                    *(f"{ratios[name]:.2f}" if ratios else "" for name in RATIOS),
                    str(round(cost.processes)),
                    f"{cost.threads:g}",
                    f"{cost.rss / MIB:.1f}",
                    f"{cost.pss / MIB:.0f}",
                ]
            )
    headings = ["Hz", "chain", "p50 us", "p99", "p99.9", "lost", "CPU s/1000"]
    headings += ["p50/raw", "p99/raw", "CPU/raw", "processes", "threads", "RSS MiB", "PSS MiB, all"]
    lines = [table(headings, rows, set(headings) - {"chain"}), ""]
    for rate, costs in results.items():
        if "calls" in costs and "together" in costs:
            calls = costs["calls"]
            lines.append(
                f"{rate:g} Hz: (c) is {ratio(costs['together'], calls, 'p50'):.2f} times the plain "
                f"calls and a hop, of which the calls are {middle(calls).calls:.0f} us"
            )
    return "\n".join(lines)
