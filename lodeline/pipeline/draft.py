"""What a pipeline file says, in its right shape; its node programs have not been looked at yet."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.params import guess, nearest, shown
from lodeline.pipeline.document import Item
from lodeline.pipeline.faults import Fault, Place
from lodeline.pipeline.hosts import read_hosts
from lodeline.pipeline.model import Clock, Host, Restart
from lodeline.pipeline.shape import NODE_NAME, Shape
from lodeline_msgs import MESSAGES, Message

MAX_QUEUE = 100_000
FILE_KEYS = ("name", "clock", "hosts", "tls", "link_rate", "external", "nodes")
NODE_KEYS = (
    *("run", "host", "process", "inputs", "outputs", "params", "rate"),
    *("restart", "restart_on_silence", "required", "priority", "cpu", "rss_mb"),
)


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
    """One node as the file declares it, `host` None if there is no such one.

    `items` are its values by key, for their places.
    """

    name: str
    place: Place
    items: dict[str, Item]
    run: str
    host: str | None
    process: str
    inputs: tuple[Wire, ...]
    outputs: tuple[Wire, ...]
    rates: dict[str, float]
    restart: Restart | None
    restart_on_silence: bool
    required: bool
    priority: int | None
    cpu: int | None
    rss_mb: float | None

    def at(self, key: str) -> Place:
        """Where the value of one of the node's keys stands; the node's name if it is not there."""
        return self.items[key].place if key in self.items else self.place


@dataclass(frozen=True, slots=True)
class Draft:
    """The whole file. `external` has the class of a key, None where there is no such class.

    `places` are those of the keys of `link_rate`.
    """

    name: str
    clock: Clock
    hosts: dict[str, Host]
    external: dict[str, type[Message] | None]
    nodes: tuple[DraftNode, ...]
    warnings: tuple[str, ...]
    tls: str | None = None
    link_rate: dict[str, float] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)


def read_draft(document: Item, faults: list[Fault]) -> Draft:
    """The draft in a document; whatever is not in shape is added to `faults` and left out."""
    shape = Shape(faults)
    if not isinstance(document.value, dict):
        text = f"a pipeline file is a mapping, got {shown(document.plain())}"
        shape.fault(document.place, text)
        return Draft("", "host", {}, {}, (), ())
    top = shape.mapping(document, "the file", FILE_KEYS)
    name = shape.value(top.get("name"), str, "name", "")
    if "name" not in top:
        shape.fault(document.place, "the pipeline has no name, write `name: ...`")
    elif isinstance(top["name"].value, str):
        shape.name(name, top["name"].place, "name")
    warnings: list[str] = []
    tls = shape.value(top.get("tls"), str, "tls")
    hosts = read_hosts(shape, top.get("hosts"), warnings, tls is not None)
    nodes = shape.mapping(top.get("nodes"), "nodes")
    if "nodes" not in top or top["nodes"].value in (None, {}):
        place = top["nodes"].key if "nodes" in top else document.place
        shape.fault(place, "the pipeline has no nodes")
    return Draft(
        name=name,
        clock=shape.value(top.get("clock"), Clock, "clock", "host"),
        hosts=hosts,
        external=_external(shape, top.get("external")),
        nodes=tuple(_node(shape, node, item, hosts) for node, item in nodes.items()),
        warnings=tuple(warnings),
        tls=tls,
        link_rate=_rates(shape, top.get("link_rate")),
        places={
            key: item.key for key, item in shape.mapping(top.get("link_rate"), "rates").items()
        },
    )


def _external(shape: Shape, item: Item | None) -> dict[str, type[Message] | None]:
    found: dict[str, type[Message] | None] = {}
    for key, member in shape.mapping(item, "external").items():
        shape.key(key, member.key)
        name = shape.value(member, str, f"message class of {key!r}", "")
        if name and name not in MESSAGES:
            shape.fault(member.place, f"unknown message class {name!r}{nearest(name, MESSAGES)}")
        found[key] = MESSAGES.get(name)
    return found


def _node(shape: Shape, name: str, item: Item, hosts: dict[str, Host]) -> DraftNode:
    shape.name(name, item.key, "node", NODE_NAME)
    what = f"node {name!r}"
    items = shape.mapping(item, what, NODE_KEYS)
    if "run" not in items and isinstance(item.value, dict | None):
        shape.fault(item.key, f"{what} names no program, write `run: nodes/....py`")
    process = shape.value(items.get("process"), str, "process", name)
    if "process" in items:
        shape.name(process, items["process"].place, "process", NODE_NAME)
    return DraftNode(
        name,
        item.key,
        items,
        run=shape.value(items.get("run"), str, "run", ""),
        host=_host_of(shape, items.get("host"), hosts),
        process=process,
        inputs=_wires(shape, items.get("inputs"), "input"),
        outputs=_wires(shape, items.get("outputs"), "output"),
        rates=_rates(shape, items.get("rate")),
        restart=shape.value(items.get("restart"), Restart, "restart"),
        restart_on_silence=_on_silence(shape, items),
        required=shape.value(items.get("required"), bool, "required", False),
        priority=shape.ranged(items.get("priority"), "priority", 1, 99),
        cpu=shape.ranged(items.get("cpu"), "cpu", 0, 1023),
        rss_mb=shape.positive(items.get("rss_mb"), float, "rss_mb"),
    )


def _on_silence(shape: Shape, items: dict[str, Item]) -> bool:
    item = items.get("restart_on_silence")
    wanted: bool = shape.value(item, bool, "restart_on_silence", False)
    if item is not None and wanted and "rate" not in items:
        shape.fault(item.place, "restart_on_silence needs a declared rate, write `rate: ...`")
    return wanted


def _host_of(shape: Shape, item: Item | None, hosts: dict[str, Host]) -> str | None:
    first = next(iter(hosts), None)
    host: str | None = shape.value(item, str, "host", first)
    if item is None or host is None or host in hosts:
        return host
    text = f"unknown host {host!r}{guess(host, hosts)} (hosts: {', '.join(hosts)})"
    shape.fault(item.place, text)
    return None


def _wires(shape: Shape, item: Item | None, what: str) -> tuple[Wire, ...]:
    found: list[Wire] = []
    for port, member in shape.mapping(item, f"{what}s").items():
        label = f"{what} {port!r}"
        options: dict[str, Item] = {}
        key: Item | None = member
        if isinstance(member.value, dict) and what == "input":
            options = shape.mapping(member, label, ("key", "queue", "max_age"))
            key = options.get("key")
            if key is None:
                shape.fault(member.place, f"{label} names no key, write `key: ...`")
        text = shape.value(key, str, f"key of {label}")
        queue = _queue(shape, options.get("queue"))
        age = shape.positive(options.get("max_age"), Annotated[float | None, "s"], "max_age")
        if key is not None and text is not None:
            shape.key(text, key.place)
            aged = "max_age" in options
            found.append(Wire(port, member.key, text, key.place, queue, age, aged))
    return tuple(found)


def _queue(shape: Shape, item: Item | None) -> int | None:
    if item is None:
        return None
    value = item.plain()
    if value == "latest":
        return 1
    if type(value) is int and 1 <= value <= MAX_QUEUE:
        return value
    text = f"queue must be latest or a whole number from 1 to {MAX_QUEUE}, got {shown(value)}"
    shape.fault(item.place, text)
    return None


def _rates(shape: Shape, item: Item | None) -> dict[str, float]:
    rates = {
        port: shape.positive(member, Annotated[float, "Hz"], f"rate of {port!r}")
        for port, member in shape.mapping(item, "rate").items()
    }
    return {port: rate for port, rate in rates.items() if rate is not None}
