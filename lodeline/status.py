"""What a process reports on its nodes once a second: rates, ages, losses, cost."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lodeline.bus import Publisher, Session
from lodeline.inlet import Inlet, counts
from lodeline.launch import Launch
from lodeline.node import Node
from lodeline_msgs import Message, NodeStatus, encoding_of, pack


class Outlet:
    """Puts what a node sends on the bus; packs only while somebody listens."""

    __slots__ = ("bytes", "publisher", "sent")

    def __init__(self, publisher: Publisher) -> None:
        self.publisher = publisher
        self.sent = 0
        self.bytes = 0

    def __call__(self, message: Message) -> None:
        self.sent += 1
        if self.publisher.watched:
            data = pack(message)
            self.bytes += len(data)
            self.publisher.put(data)


class StatusReporter:
    """Gathers the counters of every node of a process and publishes a NodeStatus for each."""

    def __init__(self, launch: Launch, nodes: Mapping[str, Node[Any]], bus: Session) -> None:
        self._launch = launch
        self._nodes = nodes
        self._outlets: dict[str, list[Outlet]] = {name: [] for name in nodes}
        self._inlets: dict[str, list[Inlet[Any]]] = {name: [] for name in nodes}
        self._puts: dict[str, Callable[[bytes], None]] = {
            name: bus.keeper(f"{launch.pipeline}/status/{name}", encoding_of(NodeStatus))
            for name in nodes
        }
        self._seq = 0
        self._since = time.monotonic()
        self._cpu = _cpu_seconds()

    def outlet(self, node: str, publisher: Publisher) -> Outlet:
        """A counted way onto the bus for one output of a node."""
        outlet = Outlet(publisher)
        self._outlets[node].append(outlet)
        return outlet

    def watch(self, node: str, inlet: Inlet[Any]) -> None:
        """Report the counters of an input of a node."""
        self._inlets[node].append(inlet)

    def send(self, stamp: int) -> None:
        """Publish the status of every node; counters of the last second start anew."""
        now, cpu = time.monotonic(), _cpu_seconds()
        elapsed, used = max(now - self._since, 1e-3), cpu - self._cpu
        self._since, self._cpu = now, cpu
        for name in self._nodes:
            status = self._status(name, stamp, elapsed, used / elapsed)
            self._puts[name](pack(status))
        self._seq += 1

    def _status(self, name: str, stamp: int, elapsed: float, cpu: float) -> NodeStatus:
        context = self._nodes[name].context
        inlets, outlets = self._inlets[name], self._outlets[name]
        ages = {inlet.key: inlet.drain_ages() for inlet in inlets}
        rates, bandwidths = {}, {}
        for outlet in outlets:
            rates[outlet.publisher.key] = outlet.sent / elapsed
            bandwidths[outlet.publisher.key] = outlet.bytes / elapsed
            outlet.sent = outlet.bytes = 0
        errors = [inlet.last_error for inlet in inlets if inlet.last_error]
        return NodeStatus(
            stamp=stamp,
            seq=self._seq,
            node=name,
            host=self._launch.host,
            state=context.state,
            pid=os.getpid(),
            pipeline=self._launch.digest,
            rates=rates,
            bandwidths=bandwidths,
            age_p50={key: _quantile(ages[key], 0.5) for key in ages if ages[key]},
            age_p99={key: _quantile(ages[key], 0.99) for key in ages if ages[key]},
            received=counts(inlets, "received"),
            lost=counts(inlets, "lost"),
            late=counts(inlets, "late"),
            rejected=dict(context.rejected),
            restarts=self._launch.restarts,
            cpu=cpu,
            rss=_resident_bytes(),
            last_error=context.last_error or (errors[0] if errors else ""),
        )


def _quantile(values: list[float], part: float) -> float:
    return values[min(len(values) - 1, int(part * len(values)))]


def _cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()
