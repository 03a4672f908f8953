"""A pipeline as it was read and found good: hosts, nodes, edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from lodeline.node import Driver, Node
from lodeline.pipeline.edge import Edge
from lodeline_msgs import Message

Restart = Literal["always", "limited", "never"]
Clock = Literal["host", "recording"]


@dataclass(frozen=True, slots=True)
class Host:
    """A machine: the address it listens on for the others, or the one it connects to.

    With `scout` it also looks for the others by multicast. `grant` are keys from outside, without
    the pipeline's name, that tools on it may send over the link, and orders that they may give.
    """

    name: str
    listen: str | None = None
    connect: str | None = None
    scout: bool = False
    grant: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class NodeSpec:
    """One node of a pipeline.

    `process` is the name of the process it shares with others, its own name if it is alone;
    `values` are its `params` as plain values, `sends` the message class of each output port,
    `rates` the expected rate [Hz] of an output port; `restart` what happens when it dies: for
    ever `always`, `limited` to 5 times a minute, or `never`; `required` stops all when it failed.
    With `restart_on_silence` it also dies when it sent nothing for 5 s on an output with a rate;
    at more than `rss_mb` megabytes (10^6 bytes) of memory its process is killed.
    """

    name: str
    run: Path
    host: str
    process: str
    values: dict[str, Any]
    sends: dict[str, type[Message]]
    type: type[Node[Any]]
    params: Any
    inputs: dict[str, Edge]
    outputs: dict[str, str]
    rates: dict[str, float]
    restart: Restart
    required: bool
    priority: int | None
    cpu: int | None
    restart_on_silence: bool = False
    rss_mb: float | None = None

    @property
    def is_driver(self) -> bool:
        """Whether it ticks by the clock: a source of samples."""
        return issubclass(self.type, Driver)


@dataclass(frozen=True, slots=True)
class Pipeline:
    """A whole pipeline; `nodes` stand in the order in which data flow.

    `name` is the first part of every key, `digest` a hash of all that decides what it computes,
    `external` the keys that come from outside the file, `clock` what ages are measured by: the
    host's time, or the newest stamp seen when the samples come from a recording. `tls` is the
    folder of the hosts' keys, `link_rate` the most samples a second [Hz] of a key that the link
    carries. `warnings` is what is not wrong, but not wise, `overrides` what replaced parameters of
    the file, as NODE.PARAM=VALUE.
    """

    name: str
    file: Path
    digest: str
    clock: Clock
    hosts: dict[str, Host]
    nodes: tuple[NodeSpec, ...]
    external: dict[str, type[Message]]
    warnings: tuple[str, ...] = ()
    tls: Path | None = None
    link_rate: Mapping[str, float] = field(default_factory=dict)
    overrides: tuple[str, ...] = ()

    def node(self, name: str) -> NodeSpec:
        """The node of that name; KeyError if there is none."""
        for spec in self.nodes:
            if spec.name == name:
                return spec
        raise KeyError(name)

    def key_types(self) -> dict[str, type[Message]]:
        """Message class of every key, external ones first, then in the order of data flow."""
        types = dict(self.external)
        for spec in self.nodes:
            types |= {key: spec.sends[port] for port, key in spec.outputs.items()}
        return types

    def read_elsewhere(self, host: str) -> set[str]:
        """Keys that nodes of other hosts than this one read."""
        specs = [spec for spec in self.nodes if spec.host != host]
        return {edge.key for spec in specs for edge in spec.inputs.values()}

    def without_programs(self) -> Pipeline:
        """The same for who starts the nodes and never is one: no `type` and no `params` of any."""
        nodes = [replace(spec, type=Node, params=None) for spec in self.nodes]
        return replace(self, nodes=tuple(nodes))

    def processes(self, host: str) -> dict[str, list[NodeSpec]]:
        """Nodes of a host by the process they share."""
        found: dict[str, list[NodeSpec]] = {}
        for spec in self.nodes:
            if spec.host == host:
                found.setdefault(spec.process, []).append(spec)
        return found
