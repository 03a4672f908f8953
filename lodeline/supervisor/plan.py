"""What is to be kept alive: one plan for each process, and how long one waits for what."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from lodeline.launch import launch_of
from lodeline.pipeline.model import NodeSpec, Pipeline, Restart
from lodeline.supervisor.backoff import BackoffParams


@dataclass(frozen=True, slots=True)
class Plan:
    """One process. `launch` gives LODELINE_LAUNCH for its n-th restart (0: the first start).

    With more than `memory` bytes resident it is killed.
    """

    name: str
    host: str
    nodes: tuple[str, ...]
    command: tuple[str, ...]
    launch: Callable[[int], str]
    restart: Restart = "limited"
    required: bool = False
    priority: int | None = None
    cpus: frozenset[int] = frozenset()
    memory: int | None = None


@dataclass(frozen=True, slots=True)
class Timing:
    """How long one waits: for READY, for all links, for a beat, after SIGABRT, after SIGTERM.

    `order` is what all processes together may delay each other's SIGTERM when they are stopped
    one after the other.
    """

    ready: Annotated[float, "s"] = 10.0
    link: Annotated[float, "s"] = 3.0
    watchdog: Annotated[float, "s"] = 2.0
    abort: Annotated[float, "s"] = 0.5
    grace: Annotated[float, "s"] = 2.0
    order: Annotated[float, "s"] = 0.5
    tick: Annotated[float, "s"] = 0.1
    backoff: BackoffParams = field(default_factory=BackoffParams)


def plans_of(
    pipeline: Pipeline,
    hosts: Sequence[str],
    folder: Path,
    epoch_offset: Callable[[], int],
    resumes: bool = False,
) -> list[Plan]:
    """Plans for the share of these hosts, in the order in which data flow.

    `epoch_offset()` [ns] is asked at each start. With `resumes` nodes go on from the states that
    are in the folder.
    """
    plans: dict[tuple[str, str], Plan] = {}
    for spec in pipeline.nodes:
        where = (spec.host, spec.process)
        if spec.host in hosts and where not in plans:
            specs = pipeline.processes(spec.host)[spec.process]
            plans[where] = _plan(pipeline, specs, folder, epoch_offset, resumes)
    return list(plans.values())


def _plan(
    pipeline: Pipeline,
    specs: list[NodeSpec],
    folder: Path,
    epoch_offset: Callable[[], int],
    resumes: bool,
) -> Plan:
    host, process = specs[0].host, specs[0].process
    program = (str(specs[0].run),) if len(specs) == 1 else ("-m", "lodeline.process")
    wanted = {spec.restart for spec in specs}
    limits = [int(spec.rss_mb * 1e6) for spec in specs if spec.rss_mb is not None]
    priorities = [spec.priority for spec in specs if spec.priority is not None]
    return Plan(
        name=process,
        host=host,
        nodes=tuple(spec.name for spec in specs),
        command=(sys.executable, "-P", *program),
        launch=lambda restarts: launch_of(
            pipeline, host, process, folder, epoch_offset(), restarts, resumes
        ).to_json(),
        restart=_most_patient(wanted),
        required=any(spec.required for spec in specs),
        priority=max(priorities, default=None),
        cpus=frozenset(spec.cpu for spec in specs if spec.cpu is not None),
        memory=max(limits, default=None),
    )


def _most_patient(wanted: set[Restart]) -> Restart:
    """A process is worth as many starts as the dearest of its nodes."""
    if "always" in wanted:
        return "always"
    return "limited" if "limited" in wanted else "never"
