"""A whole pipeline in simulated time: every driver ticks when its turn comes, nothing waits.

With the simulator among its nodes this makes recordings of a robot that never was, the same
bytes on every machine.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from functools import partial
from pathlib import Path

from lodeline.graph import Graph
from lodeline.node import Context, Driver
from lodeline.pipeline.model import Pipeline
from lodeline_msgs import Message

NANO = 1_000_000_000


def run(
    pipeline: Pipeline,
    seconds: float,
    run_folder: Path,
    listener: Callable[[str, Message], None],
    start: int = 1_700_000_000 * NANO,
) -> None:
    """Run for `seconds` from the stamp `start` [ns]; `listener` gets every key and message sent.

    Whatever a node raises ends the run: here nobody restarts it.
    """
    now = 0

    def monotonic() -> float:
        return now * 1e-9

    nodes = {
        spec.name: spec.type(spec.params, Context(spec.name, run_folder, monotonic, None))
        for spec in pipeline.nodes
    }
    graph = Graph(
        nodes,
        {
            spec.name: {port: edge.key for port, edge in spec.inputs.items()}
            for spec in pipeline.nodes
        },
        {spec.name: spec.outputs for spec in pipeline.nodes},
        _fail,
    )
    for key in graph.sent:
        graph.tap(key, partial(listener, key))
    drivers = [node for node in nodes.values() if isinstance(node, Driver)]
    ticks = [(0, place) for place in range(len(drivers))]
    counts = [0] * len(drivers)
    try:
        while ticks and ticks[0][0] < seconds * NANO:
            now, place = heapq.heappop(ticks)
            drivers[place].tick(start + now)
            counts[place] += 1
            due = round(counts[place] * NANO / drivers[place].params.rate)
            heapq.heappush(ticks, (due, place))
    finally:
        graph.close()


def _fail(name: str, message: Message, error: Exception) -> None:
    raise RuntimeError(f"{name} could not take {message}") from error
