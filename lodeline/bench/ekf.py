"""The EKF on a simulated robot: honesty, late and hidden magnets, or its cost beside filterpy.

NEES is the mean squared error in units of the covariance that the filter states: 3 for three
states, and between 2.54 and 3.50 in 95 of 100 readings. ALIASED are runs that end in a wrong cell
of the lattice, SURE those of them that do not call themselves ambiguous.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from importlib.util import find_spec
from random import Random
from typing import Any, Literal

from lodeline.bench.scenes.rides import SIGMA, mean_nees, ride, wheels_with
from lodeline.ekf import LocalizerParams
from lodeline.ekf.belief import certain
from lodeline.ekf.engine import Detection, Engine, Noise
from lodeline.ekf.engines import make_engine
from lodeline.ekf.motion import Delta
from lodeline.tables import table
from lodeline.terminal.numbers import count

NOISE = 2.3e-5  # m: variance of a wheel's way per metre of it
SETTINGS: tuple[tuple[Literal["plain", "edges"], float, float], ...] = (
    ("plain", 0.018, 0.2),  # model, way between readings [m], time between them [s]
    ("edges", 0.012, 0.2),
    ("edges", 0.006, 0.05),
)
REACH = 0.00825  # m: of a reed: it stays closed over a way of 16.5 mm
BAND = (2.54, 3.50)  # of a mean over 100 runs
STEPS, ROUNDS = 2000, 7
GATE = 9.21


def main(argv: list[str]) -> int:
    """Run `lodeline bench ekf`; the exit code."""
    arguments = parser().parse_args(argv)
    if arguments.speed:
        found: dict[str, Any] = {"speed": speed()}
    else:
        found = {
            "nees": honesty(arguments.runs),
            "late": late(arguments.runs),
            "hidden": hidden(arguments.runs),
        }
    if arguments.json:
        print(json.dumps(found, indent=1))
        return 0
    print("\n\n".join(_table(rows) for rows in found.values()))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench ekf` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench ekf",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--runs", type=count, default=100, help="simulated runs of each kind")
    parser.add_argument("--speed", action="store_true", help="only the cost of one step")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def honesty(runs: int) -> list[dict[str, Any]]:
    """Mean NEES by measurement model and rate, and the share of readings inside the band."""
    rows = []
    for model, way, interval in SETTINGS:
        params = LocalizerParams(initial_sigma=SIGMA, magnet_model=model)
        means = mean_nees(
            params, wheels_with(2e-5), way, round(interval * 1e9), runs=runs, readings=150
        )
        inside = sum(BAND[0] <= mean <= BAND[1] for mean in means) / len(means)
        rows.append(
            {
                "model": model,
                "rate_hz": 1.0 / interval,
                "nees": round(sum(means) / len(means), 2),
                "in_band_%": round(100.0 * inside, 1),
            }
        )
    return rows


def late(runs: int, delays: tuple[float, ...] = (0.0, 0.2, 0.4)) -> list[dict[str, Any]]:
    """Magnets that arrive late: put in their place by their stamps, or taken for fresh.

    Under a bar of reeds, and under one that scatters as much as the filter is told to expect.
    """
    params, wheels = LocalizerParams(initial_sigma=SIGMA), wheels_with(2e-5)
    kinds = (("reeds", REACH, False), ("scattered", None, False), ("scattered", None, True))
    rows = []
    for delay in delays:
        for magnets, reach, restamped in kinds if delay else kinds[:2]:
            squares, count, aliased = 0.0, 0, 0
            for seed in range(runs):
                steps = round(delay / 0.05)
                seen = list(
                    ride(
                        *(seed, params, wheels, 1.2),
                        delay=steps,
                        restamped=restamped,
                        reach=reach,
                    )
                )
                squares += sum(each.error**2 for each in seen)
                count += len(seen)
                aliased += seen[-1].error > 0.5 * params.lattice_pitch
            rows.append(
                {
                    "magnets": magnets,
                    "late_ms": round(1e3 * delay),
                    "fused": "as fresh" if restamped else "by stamp",
                    "rms_mm": round(1e3 * math.sqrt(squares / count), 2),
                    "aliased_%": round(100.0 * aliased / runs, 1),
                }
            )
    return rows


def hidden(runs: int, gaps: tuple[float, ...] = (0.2, 0.4, 0.6)) -> list[dict[str, Any]]:
    """No magnet seen over a gap [m]: how many runs end in a wrong cell, and say nothing."""
    rows = []
    for gap in gaps:
        for association in ("nearest", "mixture"):
            params = LocalizerParams(
                initial_sigma=SIGMA,
                association="nearest" if association == "nearest" else "mixture",
            )
            ends = []
            for seed in range(runs):
                *_, last = ride(
                    seed, params, wheels_with(NOISE), gap + 0.9, hidden=(0.3, 0.3 + gap)
                )
                ends.append(last)
            wrong = [each for each in ends if each.error > 0.5 * params.lattice_pitch]
            sure = [each for each in wrong if not each.estimate.ambiguous]
            rows.append(
                {
                    "hidden_mm": round(1e3 * gap),
                    "association": association,
                    "aliased_%": round(100.0 * len(wrong) / runs, 1),
                    "aliased_and_sure_%": round(100.0 * len(sure) / runs, 1),
                }
            )
    return rows


def speed() -> list[dict[str, Any]]:
    """Microseconds of a prediction and a gated update of two numbers, engines taking turns.

    The fastest of the rounds counts, in time of this thread: a busy machine is busy for both.
    """
    engines = {"scalar": make_engine("scalar")}
    if find_spec("filterpy"):
        engines["filterpy"] = make_engine("filterpy")
    best = dict.fromkeys(engines, math.inf)
    for _ in range(ROUNDS):
        for name, engine in engines.items():
            steps = STEPS if name == "scalar" else STEPS // 10
            best[name] = min(best[name], _seconds_per_step(engine, steps))
    return [
        {
            "engine": name,
            "us_per_step": round(1e6 * seconds, 2),
            "times_scalar": round(seconds / best["scalar"], 1),
        }
        for name, seconds in best.items()
    ]


def _seconds_per_step(engine: Engine, steps: int) -> float:
    rng = Random(1)
    noise = Noise(1e-7, 1e-7, 1e-4)
    belief = certain(0.0, 0.0, 0.0).widened(0.01, 0.05)
    deltas = [Delta(0.004, 0.0, rng.gauss(0, 0.05)) for _ in range(steps)]
    begun = time.thread_time()
    for delta in deltas:
        belief = engine.predict(belief, delta, noise)
        # where it is expected: the gate lets each of them in
        at = belief.x + 0.08 * math.cos(belief.yaw), belief.y + 0.08 * math.sin(belief.yaw)
        detection = Detection(0.08, 0.001, 2e-5, 1e-5, *at)
        if engine.weigh(belief, detection).nis <= GATE:
            belief = engine.correct(belief, detection)
    return (time.thread_time() - begun) / steps


def _table(rows: list[dict[str, Any]]) -> str:
    headings = tuple(name.replace("_", " ").upper() for name in rows[0])
    numbers = [
        heading
        for heading, value in zip(headings, rows[0].values(), strict=True)
        if not isinstance(value, str)
    ]
    cells = [tuple(str(value) for value in row.values()) for row in rows]
    return table(headings, cells, right=numbers)
