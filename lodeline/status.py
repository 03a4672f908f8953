"""What a process reports on its nodes once a second: rates, ages, losses, cost."""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import Any

from lodeline.bus import Publisher, Session
from lodeline.health import Complaint, Pace, worst
from lodeline.inlet import Inlet, counts
from lodeline.launch import Launch
from lodeline.memory import resident
from lodeline.node import Driver, Node
from lodeline.recent import KEPT_S, Recent, recent_key
from lodeline_msgs import Message, NodeStatus, encoding_of, pack

LONGEST_TEXT = 500
MOST_MISSED = 0.05
"""A driver that skips a larger part of its ticks in a second is degraded."""


class Outlet:
    """Puts what a node sends on the bus; packs only while somebody listens.

    And for a while after: a listener whose link was cut will ask for it (`recent`).
    """

    __slots__ = (
        *("_kept_until", "_pace", "bytes", "last", "muted", "packed", "publisher", "recent"),
        *("sent", "total"),
    )

    def __init__(self, publisher: Publisher, recent: Recent, expected: float | None = None) -> None:
        self.publisher = publisher
        self.recent = recent
        self._kept_until = 0.0
        self.muted = False
        self.sent = 0
        self.total = 0
        self.bytes = 0
        self.packed = 0
        self.last = 0.0
        self._pace = None
        if expected is not None:
            self._pace = Pace(publisher.key, expected, time.monotonic())

    def __call__(self, message: Message) -> None:
        if self.muted:
            return
        self.sent += 1
        self.last = now = time.monotonic()
        if self.publisher.watched:
            data = pack(message)
            self.bytes += len(data)
            self.packed += 1
            self.publisher.put(data)
            self.recent.keep(message, data)
            self._kept_until = now + KEPT_S
        elif now < self._kept_until:
            self.recent.keep(message, pack(message))

    @property
    def paced(self) -> bool:
        """Whether a rate is expected of it."""
        return self._pace is not None

    def drain(self, elapsed: float) -> tuple[float, float]:
        """Samples and bytes a second since the last call, `elapsed` seconds ago.

        Where somebody began to listen meanwhile, the bytes are those of a whole such time.
        """
        rate = self.sent / elapsed
        rates = rate, rate * self.bytes / max(1, self.packed)
        self.total += self.sent
        self.sent = self.bytes = self.packed = 0
        return rates

    def complaint(self, now: float) -> Complaint | None:
        """What is to be said of its rate; after `drain`."""
        return None if self._pace is None else self._pace.judge(now, self.total, self.last)


class StatusReporter:
    """Gathers the counters of every node of a process and publishes a NodeStatus for each."""

    def __init__(self, launch: Launch, nodes: Mapping[str, Node[Any]], bus: Session) -> None:
        self._launch = launch
        self._nodes = nodes
        self._outlets: dict[str, list[Outlet]] = {name: [] for name in nodes}
        self._inlets: dict[str, list[Inlet[Any]]] = {name: [] for name in nodes}
        self._bus = bus
        self._kept: list[Recent] = []
        keys = {name: f"{launch.pipeline}/status/{name}" for name in nodes}
        self._puts: dict[str, Callable[[bytes], None]] = {
            name: bus.keeper(key, encoding_of(NodeStatus)) for name, key in keys.items()
        }
        self._recents = {name: self._recent(key) for name, key in keys.items()}
        self._told: Counter[tuple[str, str]] = Counter()
        self.complaints: list[Complaint] = []
        self._seq = 0
        self._since = time.monotonic()
        self._cpu = time.process_time()

    def outlet(self, node: str, publisher: Publisher, expected: float | None = None) -> Outlet:
        """A counted way onto the bus for one output of a node, `expected` times a second."""
        outlet = Outlet(publisher, self._recent(publisher.key), expected)
        self._outlets[node].append(outlet)
        return outlet

    def _recent(self, key: str) -> Recent:
        recent = Recent(self._bus.id)
        self._kept.append(recent)
        self._bus.serve_told(recent_key(key), recent.answer)
        return recent

    def silence(self, node: str, since: float) -> float:
        """How long [s] the output of a node was silent that was so longest, of those with a rate.

        Before `since` [s, monotonic] nobody expected anything.
        """
        now = time.monotonic()
        paced = [outlet for outlet in self._outlets[node] if outlet.paced]
        return max((now - max(outlet.last, since) for outlet in paced), default=0.0)

    def mute(self, muted: bool) -> None:
        """Keep what all nodes send off the bus, or no more."""
        for outlets in self._outlets.values():
            for outlet in outlets:
                outlet.muted = muted

    def inlets(self, node: str) -> list[Inlet[Any]]:
        """The inputs of a node that are reported on."""
        return self._inlets[node]

    def watch(self, node: str, inlet: Inlet[Any]) -> None:
        """Report the counters of an input of a node."""
        self._inlets[node].append(inlet)

    def send(self, stamp: int) -> None:
        """Publish the status of every node; counters of the last second start anew.

        `complaints` is then what is wrong with them, as found here.
        """
        self.complaints = []
        now, cpu = time.monotonic(), time.process_time()
        elapsed, used = max(now - self._since, 1e-3), cpu - self._cpu
        self._since, self._cpu = now, cpu
        for name in self._nodes:
            status = self._status(name, stamp, elapsed, used / elapsed, now)
            data = pack(status)
            self._puts[name](data)
            self._recents[name].keep(status, data)
        for recent in self._kept:
            recent.pack()
        self._seq += 1

    def pack_many(self) -> None:
        """Compress what fast outputs sent; between two reports, so that none takes long."""
        for recent in self._kept:
            if recent.many:
                recent.pack()

    def _status(self, name: str, stamp: int, elapsed: float, cpu: float, now: float) -> NodeStatus:
        context = self._nodes[name].context
        inlets, outlets = self._inlets[name], self._outlets[name]
        ages = {inlet.key: inlet.drain_ages() for inlet in inlets}
        rates, bandwidths = {}, {}
        for outlet in outlets:
            key = outlet.publisher.key
            rates[key], bandwidths[key] = outlet.drain(elapsed)
        found = self._complaints(name, now)
        self.complaints += found
        # what it says of itself is why nothing comes out of it
        own = [context.last_error] if context.state != "running" and context.last_error else []
        first = next((inlet.last_error for inlet in inlets if inlet.last_error), "")
        return NodeStatus(
            stamp=stamp,
            seq=self._seq,
            node=name,
            host=self._launch.host,
            state=worst([context.state, *(complaint.state for complaint in found)]),
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
            rss=resident(os.getpid()),
            last_error="; ".join([*own, *map(str, found)]) or context.last_error or first,
            jitter=_drained(context.lateness),
        )

    def _complaints(self, name: str, now: float) -> list[Complaint]:
        context = self._nodes[name].context
        found = [item for inlet in self._inlets[name] for item in inlet.complaints()]
        paces = [outlet.complaint(now) for outlet in self._outlets[name]]
        if raised := self._new(name, "exception"):
            text = f"{raised} in the last second, the last {context.last_error}"
            found.append(Complaint("degraded", f"EXCEPTIONS {name}", text))
        node = self._nodes[name]
        missed = self._new(name, "missed tick")
        if isinstance(node, Driver) and missed > MOST_MISSED * node.params.rate:
            why = "too much else runs here, or its device hangs"
            text = f"{missed} of {node.params.rate:g} in the last second, {why}"
            found.append(Complaint("degraded", f"MISSED_TICKS {name}", text))
        return [*found, *(pace for pace in paces if pace is not None)]

    def _new(self, name: str, cause: str) -> int:
        """How many of a node's samples or ticks were lost to a cause since the last look."""
        now = self._nodes[name].context.rejected[cause]
        new, self._told[name, cause] = now - self._told[name, cause], now
        return new

    def text(self) -> str:
        """What is wrong with the nodes of this process, in words; empty if nothing is."""
        states = [
            f"{name} is in {node.context.state}: {node.context.last_error}"
            for name, node in self._nodes.items()
            if node.context.state != "running"
        ]
        # One line of bounded length: it goes out as a line of a datagram.
        return " ".join("; ".join([*states, *map(str, self.complaints)]).split())[:LONGEST_TEXT]


def _quantile(values: list[float], part: float) -> float:
    return values[min(len(values) - 1, int(part * len(values)))]


def _drained(lateness: deque[float]) -> float:
    """The 99th percentile of what is in it; it is empty then."""
    values = sorted(lateness.popleft() for _ in range(len(lateness)))
    return _quantile(values, 0.99) if values else 0.0
