"""What one update of an attitude method costs, beside the others in the same run.

All take turns, so that a busy machine is busy for all of them; the fastest of their rounds counts,
in time of this thread. Microseconds are this machine's, ratios hardly depend on it.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from importlib.util import find_spec
from random import Random

from lodeline.bench.peers import Contender, FilterPy, Maker
from lodeline.rotation import Vector
from lodeline.tables import table

RATE = 200.0  # Hz
SAMPLES, ROUNDS = 1000, 15
UNIT = "dcm"  # the published algorithm, in scalar Python

Sample = tuple[Vector, Vector, Vector | None]


def show(makers: Mapping[str, Maker], as_json: bool) -> None:
    """Measure, with filterpy beside them if it is there, and print."""
    if find_spec("filterpy"):
        makers = {**makers, "filterpy, 6 states": FilterPy}
    costs = measure(makers)
    if as_json:
        print(json.dumps(costs, indent=1))
        return
    rows = [
        (name, f"{1e6 * cost:.1f}", f"{cost / costs[UNIT]:.2f}")
        for name, cost in sorted(costs.items(), key=lambda item: item[1])
    ]
    headings = ("METHOD", "US PER UPDATE", f"TIMES {UNIT}")
    print(table(headings, rows, right=headings[1:]))


def measure(makers: Mapping[str, Maker], rounds: int = ROUNDS) -> dict[str, float]:
    """Seconds per update and reading of the orientation, by method; field every other sample."""
    samples = shaken()
    contenders = {name: maker(1.0 / RATE) for name, maker in makers.items()}
    best = dict.fromkeys(contenders, float("inf"))
    for _ in range(rounds):
        for name, contender in contenders.items():
            best[name] = min(best[name], _once(contender, samples))
    return best


def _once(contender: Contender, samples: list[Sample]) -> float:
    update, dt = contender.update, 1.0 / RATE
    begun = time.thread_time()
    for rate, force, field in samples:
        update(dt, rate, force, field)
        _ = contender.orientation
    return (time.thread_time() - begun) / len(samples)


def shaken() -> list[Sample]:
    """Readings of a board moved by hand, always the same."""
    rng = Random(1)

    def around(x: float, y: float, z: float, std: float) -> Vector:
        return (x + rng.gauss(0.0, std), y + rng.gauss(0.0, std), z + rng.gauss(0.0, std))

    return [
        (
            around(0.2, 0.1, 0.5, 0.3),
            around(0.0, 0.0, 9.81, 1.0),
            None if i % 2 else around(5e-6, 18e-6, -40e-6, 5e-7),
        )
        for i in range(SAMPLES)
    ]
