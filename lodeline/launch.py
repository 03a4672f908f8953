"""What the supervisor tells a process that it starts: which nodes it is, and where its wires go.

Passed as JSON in the environment variable LODELINE_LAUNCH, so that a node process needs to
read neither the pipeline file nor YAML.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lodeline.pipeline.edge import Edge

if TYPE_CHECKING:  # only who launches knows the whole pipeline
    from lodeline.pipeline.model import NodeSpec, Pipeline

VARIABLE = "LODELINE_LAUNCH"


@dataclass(frozen=True, slots=True)
class NodeLaunch:
    """One node of a process.

    `awaited` are its output ports with a consumer on this host, `guarded` its input ports that
    only a process of this host may send to, `rates` the rates [Hz] expected of output ports; with
    `restart_on_silence` it ends when one of these was silent for long.
    """

    name: str
    run: str
    params: dict[str, Any]
    inputs: dict[str, Edge]
    outputs: dict[str, str]
    awaited: tuple[str, ...]
    guarded: tuple[str, ...] = ()
    rates: dict[str, float] = field(default_factory=dict)
    restart_on_silence: bool = False


@dataclass(frozen=True, slots=True)
class Launch:
    """One process: where it runs, whose it is, what it runs.

    `epoch_offset` [ns] turns this host's monotonic clock into stamps; `restarts` counts the
    predecessors of this process in this run of the pipeline, `neighbours` the other processes
    of the host, which it must be linked with before sources are let go. With `resumes`, nodes go on
    from the states of a run that died.
    """

    pipeline: str
    digest: str
    host: str
    process: str
    run_folder: str
    epoch_offset: int
    clock: str
    restarts: int
    neighbours: int
    nodes: tuple[NodeLaunch, ...]
    resumes: bool = False

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Launch:
        """ValueError, KeyError or TypeError if the text is no launch of this version."""
        values = json.loads(text)
        values["nodes"] = tuple(
            NodeLaunch(
                **{
                    **node,
                    "inputs": {port: Edge(**edge) for port, edge in node["inputs"].items()},
                    "awaited": tuple(node["awaited"]),
                    "guarded": tuple(node["guarded"]),
                }
            )
            for node in values["nodes"]
        )
        return cls(**values)


def launch_of(
    pipeline: Pipeline,
    host: str,
    process: str,
    run_folder: Path,
    epoch_offset: int,
    restarts: int = 0,
    resumes: bool = False,
) -> Launch:
    """The launch of one process of a pipeline on a host."""
    processes = pipeline.processes(host)
    return Launch(
        pipeline=pipeline.name,
        digest=pipeline.digest,
        host=host,
        process=process,
        run_folder=str(run_folder),
        epoch_offset=epoch_offset,
        clock=pipeline.clock,
        restarts=restarts,
        neighbours=len(processes) - 1,
        nodes=tuple(_node_launch(pipeline, spec) for spec in processes[process]),
        resumes=resumes,
    )


def _node_launch(pipeline: Pipeline, spec: NodeSpec) -> NodeLaunch:
    # Keys that another process of this host reads: its source waits until they are linked.
    wanted = {
        edge.key
        for other in pipeline.nodes
        if other.host == spec.host and other.process != spec.process
        for edge in other.inputs.values()
    }
    awaited = tuple(port for port, key in spec.outputs.items() if key in wanted)
    sent_here = {
        key for other in pipeline.nodes if other.host == spec.host for key in other.outputs.values()
    }
    guarded = tuple(port for port, edge in spec.inputs.items() if edge.key in sent_here)
    return NodeLaunch(
        name=spec.name,
        run=str(spec.run),
        params=spec.values,
        inputs=spec.inputs,
        outputs=spec.outputs,
        awaited=awaited,
        guarded=guarded,
        # Played recordings are as fast as they are played.
        rates=spec.rates if pipeline.clock == "host" else {},
        restart_on_silence=spec.restart_on_silence,
    )
