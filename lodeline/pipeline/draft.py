"""What a pipeline file says, in its right shape; its node programs have not been looked at yet."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Annotated, Any

from lodeline.params import closest, convert, guess, nearest, shown
from lodeline.pipeline.document import Item
from lodeline.pipeline.faults import Fault, Place
from lodeline.pipeline.model import Clock, Host, Restart
from lodeline_msgs import MESSAGES, Message

MAX_QUEUE = 100_000
FILE_KEYS = ("name", "clock", "hosts", "external", "nodes")
NODE_KEYS = (
    *("run", "host", "process", "inputs", "outputs", "params", "rate"),
    *("restart", "required", "priority", "cpu"),
)
_NAME = re.compile(r"[a-z][a-z0-9_-]*")
_NODE_NAME = re.compile(r"[a-z][a-z0-9_]*")  # it is part of a key: status/NAME
_KEY = re.compile(r"[a-z0-9_]+(/[a-z0-9_]+)*")
_ADDRESS = re.compile(r"((tcp|tls)/)?(\[[0-9a-fA-F:]+\]|[A-Za-z0-9.-]+)(:[0-9]{1,5})?")
_LOOPBACK = re.compile(r"(tcp/)?(127\.[0-9.]+|\[::1\]|localhost)(:[0-9]+)?")


@dataclass(frozen=True, slots=True)
class Wire:
    """A port of a node and the key that it is wired to.

    `queue` None: as the node's program says. `max_age` counts only if `aged`: the file gives one.
    """

    port: str
    port_place: Place
    key: str
    place: Place
    queue: int | None = None
    max_age: float | None = None
    aged: bool = False


@dataclass(frozen=True, slots=True)
class DraftNode:
    """One node as the file declares it; `items` are its values by key, for their places."""

    name: str
    place: Place
    items: dict[str, Item]
    run: str
    host: str
    process: str
    inputs: tuple[Wire, ...]
    outputs: tuple[Wire, ...]
    rates: dict[str, float]
    restart: Restart | None
    required: bool
    priority: int | None
    cpu: int | None

    def at(self, key: str) -> Place:
        """Where the value of one of the node's keys stands; the node's name if it is not there."""
        return self.items[key].place if key in self.items else self.place


@dataclass(frozen=True, slots=True)
class Draft:
    """The whole file. `external` has the class of a key, None where there is no such class."""

    name: str
    clock: Clock
    hosts: dict[str, Host]
    external: dict[str, tuple[type[Message] | None, Place]]
    nodes: tuple[DraftNode, ...]
    warnings: tuple[str, ...]


def read_draft(document: Item, faults: list[Fault]) -> Draft:
    """The draft in a document; whatever is not in shape is added to `faults` and left out."""
    return _Reader(faults).draft(document)


@dataclass(slots=True)
class _Reader:
    faults: list[Fault]
    hosts: dict[str, Host] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def fault(self, place: Place, text: str) -> None:
        self.faults.append(place.fault(text))

    def mapping(
        self, item: Item | None, what: str, known: Iterable[str] | None = None
    ) -> dict[str, Item]:
        if item is None:
            return {}
        if not isinstance(item.value, dict):
            self.fault(item.place, f"{what} must be a mapping, got {shown(item.plain())}")
            return {}
        if known is None:
            return item.value
        names = list(known)
        found: dict[str, Item] = {}
        for name, member in item.value.items():
            if name not in names:
                self.fault(member.key, f"unknown key {name!r} in {what}{nearest(name, names)}")
                # Read as what it was meant to be, so that one slip is one fault.
                name = closest(name, [free for free in names if free not in item.value]) or name
            found.setdefault(name, member)
        return found

    def value(self, item: Item | None, hint: Any, what: str, default: Any = None) -> Any:
        if item is None:
            return default
        problems: list[Any] = []
        value = convert(item.plain(), hint, what, (), problems)
        for problem in problems:
            self.fault(item.place, problem.text)
        return default if problems else value

    def ranged(self, item: Item | None, hint: Any, what: str, low: float, high: float) -> Any:
        """A number from `low` to `high` inclusive, or None."""
        value = self.value(item, hint, what)
        if item is not None and value is not None and not low <= value <= high:
            self.fault(item.place, f"{what} must be from {low:g} to {high:g}, got {value:g}")
            return None
        return value

    def positive(self, item: Item | None, hint: Any, what: str) -> Any:
        """A number above zero, or None."""
        value = self.value(item, hint, what)
        if item is not None and value is not None and value <= 0:
            self.fault(item.place, f"{what} must be positive, got {value:g}")
            return None
        return value

    def named(self, name: str, place: Place, what: str, pattern: re.Pattern[str]) -> None:
        if not pattern.fullmatch(name):
            dash = ", -" if pattern is _NAME else ""
            text = f"{what} {name!r} must start with a-z and hold only a-z, 0-9, _{dash}"
            self.fault(place, text)

    def draft(self, document: Item) -> Draft:
        top = self.mapping(document, "the file", FILE_KEYS)
        if not isinstance(document.value, dict):
            return Draft("", "host", {}, {}, (), ())
        if "name" not in top:
            self.fault(document.place, "the pipeline has no name, write `name: ...`")
        name = self.value(top.get("name"), str, "name", "")
        if name:
            self.named(name, top["name"].place, "name", _NAME)
        clock = self.value(top.get("clock"), Clock, "clock", "host")
        self.read_hosts(top.get("hosts"))
        external = self.external(self.mapping(top.get("external"), "external"))
        if "nodes" not in top:
            self.fault(document.place, "the pipeline has no nodes, write `nodes: ...`")
        nodes = self.mapping(top.get("nodes"), "nodes")
        if "nodes" in top and top["nodes"].value == {}:
            self.fault(top["nodes"].place, "the pipeline has no nodes")
        drafts = tuple(self.node(node, item) for node, item in nodes.items())
        return Draft(name, clock, self.hosts, external, drafts, tuple(self.warnings))

    def read_hosts(self, item: Item | None) -> None:
        if item is None:
            self.hosts["robot"] = Host("robot")
            return
        hosts = self.mapping(item, "hosts")
        if item.value == {}:
            self.fault(item.place, "hosts names no host")
        for name, member in hosts.items():
            self.hosts[name] = self.host(name, member, alone=len(hosts) == 1)
        if len(hosts) > 1 and not any(host.listen for host in self.hosts.values()):
            self.fault(item.key, "no host listens, so the hosts cannot reach each other")

    def host(self, name: str, item: Item, alone: bool) -> Host:
        self.named(name, item.key, "host", _NAME)
        what = f"host {name!r}"
        ways = {} if item.value is None else self.mapping(item, what, ("listen", "connect"))
        listen = self.address(ways.get("listen"), "listen")
        connect = self.address(ways.get("connect"), "connect")
        if len(ways) > 1:
            self.fault(item.key, f"{what} can listen or connect, not both")
        elif not ways and not alone and item.value in (None, {}):
            text = f"{what} has no address, write `listen: ...` or `connect: ...`"
            self.fault(item.key, text)
        if listen and not listen.startswith("tls/") and not _LOOPBACK.fullmatch(listen):
            place = ways["listen"].place
            text = f"{what} listens on {listen} without tls: anyone on that network can read and"
            self.warnings.append(str(place.fault(f"{text} send")))
        return Host(name, listen, connect)

    def address(self, item: Item | None, what: str) -> str | None:
        text: str | None = self.value(item, str, what)
        if item is None or text is None:
            return None
        parts = _ADDRESS.fullmatch(text)
        if parts is None or (parts[4] and not 0 < int(parts[4][1:]) < 65536):
            self.fault(item.place, f"{what} must be [tcp/|tls/]ADDRESS[:PORT], got {text!r}")
            return None
        return text

    def external(self, items: dict[str, Item]) -> dict[str, tuple[type[Message] | None, Place]]:
        found: dict[str, tuple[type[Message] | None, Place]] = {}
        for key, item in items.items():
            self.key(key, item.key)
            name = self.value(item, str, f"message class of {key!r}", "")
            if name and name not in MESSAGES:
                text = f"unknown message class {name!r}{nearest(name, MESSAGES)}"
                self.fault(item.place, text)
            found[key] = MESSAGES.get(name), item.key
        return found

    def key(self, key: str, place: Place) -> None:
        if not _KEY.fullmatch(key):
            text = "may hold a-z, 0-9 and _, in parts separated by /"
            self.fault(place, f"key {key!r} {text}")
        elif key.split("/")[0] == "status":
            self.fault(place, f"key {key!r} is reserved: nodes send their health there")

    def node(self, name: str, item: Item) -> DraftNode:
        self.named(name, item.key, "node", _NODE_NAME)
        what = f"node {name!r}"
        items = self.mapping(item, what, NODE_KEYS)
        if "run" not in items and isinstance(item.value, dict):
            self.fault(item.key, f"{what} names no program, write `run: nodes/....py`")
        process = self.value(items.get("process"), str, "process", name)
        if "process" in items:
            self.named(process, items["process"].place, "process", _NODE_NAME)
        return DraftNode(
            name,
            item.key,
            items,
            run=self.value(items.get("run"), str, "run", ""),
            host=self.node_host(items.get("host")),
            process=process,
            inputs=self.wires(items.get("inputs"), "input"),
            outputs=self.wires(items.get("outputs"), "output"),
            rates=self.rates(items.get("rate")),
            restart=self.value(items.get("restart"), Restart, "restart"),
            required=self.value(items.get("required"), bool, "required", False),
            priority=self.ranged(items.get("priority"), int, "priority", 1, 99),
            cpu=self.ranged(items.get("cpu"), int, "cpu", 0, 1023),
        )

    def node_host(self, item: Item | None) -> str:
        host = str(self.value(item, str, "host", next(iter(self.hosts), "")))
        if item is not None and host not in self.hosts:
            text = f"unknown host {host!r}{guess(host, self.hosts)}"
            self.fault(item.place, f"{text} (hosts: {', '.join(self.hosts)})")
        return host

    def wires(self, item: Item | None, what: str) -> tuple[Wire, ...]:
        found: list[Wire] = []
        for port, member in self.mapping(item, f"{what}s").items():
            label = f"{what} {port!r}"
            options: dict[str, Item] = {}
            key: Item | None = member
            if isinstance(member.value, dict) and what == "input":
                options = self.mapping(member, label, ("key", "queue", "max_age"))
                key = options.get("key")
                if key is None:
                    self.fault(member.place, f"{label} names no key, write `key: ...`")
            text = self.value(key, str, f"key of {label}")
            if key is not None and text is not None:
                self.key(text, key.place)
                age = self.positive(options.get("max_age"), Annotated[float | None, "s"], "max_age")
                queue = self.queue(options.get("queue"))
                aged = "max_age" in options
                found.append(Wire(port, member.key, text, key.place, queue, age, aged))
        return tuple(found)

    def queue(self, item: Item | None) -> int | None:
        if item is None:
            return None
        value = item.plain()
        if value == "latest":
            return 1
        if type(value) is int and 1 <= value <= MAX_QUEUE:
            return value
        text = f"queue must be latest or a whole number from 1 to {MAX_QUEUE}, got {shown(value)}"
        self.fault(item.place, text)
        return None

    def rates(self, item: Item | None) -> dict[str, float]:
        rates = {
            port: self.positive(member, Annotated[float, "Hz"], f"rate of {port!r}")
            for port, member in self.mapping(item, "rate").items()
        }
        return {port: rate for port, rate in rates.items() if rate is not None}
