"""What the page is told once of a pipeline: its keys, its wiring, its floor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lodeline.ekf import LocalizerParams
from lodeline.keys import is_truth
from lodeline.pipeline.model import Pipeline
from lodeline.recording.localizer import params_of
from lodeline.run_folder import Manifest
from lodeline.watch import SILENT_S, parted
from lodeline_msgs import NodeStatus, Twist


def badge(manifest: Manifest) -> str:
    """REPLAY for the clock of a recording, SIMULATED where a truth is told, else LIVE."""
    if manifest.clock == "recording":
        return "REPLAY"
    told = any(is_truth(key) and known.node for key, known in manifest.keys.items())
    return "SIMULATED" if told else "LIVE"


def drive_key(manifest: Manifest) -> str | None:
    """The full key that takes commands from outside, if there is just one."""
    keys = [
        key
        for key, known in manifest.keys.items()
        if known.type == Twist.__name__ and known.node is None
    ]
    return keys[0] if len(keys) == 1 else None


def scene(manifest: Manifest, pipeline: Pipeline | None) -> dict[str, Any]:
    """All that does not change while the pipeline runs, as plain values."""
    prefix = f"{manifest.name}/"
    return {
        "t": "scene",
        "name": manifest.name,
        "badge": badge(manifest),
        "hosts": list(manifest.hosts),
        "started": manifest.started,
        "digest": manifest.digest,
        "keys": {
            key.removeprefix(prefix): {"type": known.type, "node": known.node}
            for key, known in manifest.keys.items()
        },
        "nodes": _nodes(manifest, pipeline),
        "edges": _edges(manifest, prefix),
        "floor": _floor(pipeline),
        "drive": drive_key(manifest) is not None,
    }


def _nodes(manifest: Manifest, pipeline: Pipeline | None) -> dict[str, dict[str, Any]]:
    """Nodes in the order of the data flow: their process, and the rates that they promise."""
    if pipeline is None:
        return {name: {"process": group, "rates": {}} for name, group in manifest.nodes.items()}
    prefix = f"{manifest.name}/"
    return {
        spec.name: {
            "process": spec.process,
            "rates": {
                spec.outputs[port].removeprefix(prefix): rate for port, rate in spec.rates.items()
            },
        }
        for spec in pipeline.nodes
    }


def _edges(manifest: Manifest, prefix: str) -> list[dict[str, Any]]:
    return [
        {
            "key": key.removeprefix(prefix),
            "from": manifest.keys[key].node if key in manifest.keys else None,
            "to": reader.node,
            "queue": reader.queue,
            "max_age": reader.max_age,
        }
        for key, readers in manifest.readers.items()
        for reader in readers
    ]


def _floor(pipeline: Pipeline | None) -> dict[str, Any]:
    """Where the magnets lie, how far ahead the bar is, what the gate lets in.

    Taken from the pipeline's localiser, or its defaults where nobody can tell.
    """
    params = params_of(pipeline) or LocalizerParams()
    return {
        "pitch": params.cell,
        "origin": list(params.lattice_origin),
        "bar_x": params.bar_x,
        "gate": params.gate,
    }


def brief(value: Any) -> Any:
    """A value with floats to seven digits: more than a page can show, half as many bytes."""
    if isinstance(value, float):
        return float(f"{value:.7g}") if math.isfinite(value) else None
    if isinstance(value, tuple | list):
        return [brief(part) for part in value]
    if isinstance(value, Mapping):
        return {key: brief(part) for key, part in value.items()}
    return value


def status_of(status: NodeStatus, prefix: str, age: float) -> dict[str, Any]:
    """What a node said of itself `age` seconds ago, its keys without the pipeline's name.

    Of one that is silent, what it has counted stays; that it sends nothing is all that is known.
    """
    silent = age > SILENT_S
    ticks, refused = parted(status)

    def short(counters: Mapping[str, Any]) -> dict[str, Any]:
        return {key.removeprefix(prefix): brief(value) for key, value in counters.items()}

    return {
        "host": status.host,
        "state": status.state,
        "pid": status.pid,
        "rates": short(dict.fromkeys(status.rates, 0.0) if silent else status.rates),
        "age_p50": {} if silent else short(status.age_p50),
        "age_p99": {} if silent else short(status.age_p99),
        "received": short(status.received),
        "lost": short(status.lost),
        "late": short(status.late),
        "rejected": refused,
        "ticks": ticks,
        "restarts": status.restarts,
        "cpu": 0.0 if silent else brief(status.cpu),
        "rss": status.rss,
        "last_error": status.last_error,
        "jitter": brief(status.jitter),
        "age": brief(age),
    }
