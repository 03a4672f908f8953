"""The node contract: a class with ports and handlers that runs anywhere.

A node knows neither zenoh nor a clock. The same class runs in a process of its own, beside
neighbours in one process, or over a recording in a test, and sends the same bytes in all three.
"""

from __future__ import annotations

import sys
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import (
    Any,
    ClassVar,
    Generic,
    NamedTuple,
    Protocol,
    TypeVar,
    get_args,
    get_origin,
    overload,
)

from lodeline_msgs import Message

MOST_LATENESS = 4096
"""Ticks whose lateness is kept, until the next report takes them."""

_number = Message.__dict__["seq"].__set__

M = TypeVar("M", bound=Message)
P = TypeVar("P")


class Input(Generic[M]):
    """A port that takes samples of one message class.

    `queue` samples may wait for the handler (the newest are kept), none older than `max_age`
    seconds (None: of any age). Both are defaults that the pipeline file may override.
    """

    def __init__(self, message: type[M], *, queue: int = 1, max_age: float | None = None) -> None:
        self.message = message
        self.queue = queue
        self.max_age = max_age
        self.name = ""
        self.method = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def handler(self, method: Callable[[Any, M], None]) -> Callable[[Any, M], None]:
        """Decorator: the method that takes each sample of this port."""
        self.method = method.__name__
        return method


class Sender(Generic[M]):
    """An output port of a living node: numbers each sample and hands it to all who listen."""

    __slots__ = ("seq", "sinks")

    def __init__(self) -> None:
        self.seq = 0
        self.sinks: list[Callable[[M], None]] = []

    def send(self, message: M) -> None:
        """Hand a new message to every listener; it must not be sent twice."""
        # Its number is its sender's to give, and nobody has seen the message yet.
        seq = self.seq
        _number(message, seq)
        self.seq = seq + 1
        for sink in self.sinks:
            sink(message)


class Output(Generic[M]):
    """A port that sends samples of one message class: `self.odom.send(Odometry(...))`."""

    def __init__(self, message: type[M]) -> None:
        self.message = message
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, node: None, owner: type) -> Output[M]: ...
    @overload
    def __get__(self, node: Node[Any], owner: type) -> Sender[M]: ...
    def __get__(self, node: Node[Any] | None, owner: type) -> Output[M] | Sender[M]:
        return self if node is None else node.senders[self.name]


class Health(Protocol):
    """How a device fares, in its driver's words: `ok` or not, and the last thing worth telling."""

    @property
    def state(self) -> str: ...
    @property
    def message(self) -> str: ...


def log(text: str) -> None:
    """A line on the log of this process."""
    print(text, file=sys.stderr, flush=True)


@dataclass(slots=True)
class Context:
    """What a node may ask of the place it runs in, and what it tells about itself.

    `state` is `running`, `degraded` (usable, less accurate) or `fault` (not usable). `monotonic`
    [s] is for simulated devices, which live in a time of their own; nothing else needs a clock.
    `sim_timeout` [s] is how long their bus may take to answer, see `open_bus`.
    `say` takes what a person should read.
    `lateness` [s] is how late its last ticks began.
    """

    name: str = "node"
    run_folder: Path = field(default_factory=Path)
    monotonic: Callable[[], float] = time.monotonic
    sim_timeout: float | None = 0.1
    state: str = "running"
    last_error: str = ""
    rejected: Counter[str] = field(default_factory=Counter)
    say: Callable[[str], None] = log
    lateness: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_LATENESS))

    @property
    def sim_socket(self) -> Path:
        """Where the simulator of this host serves its I2C bus, for `bus: sim`."""
        return self.run_folder / "i2c.sock"

    def report(self, state: str, text: str) -> None:
        """Say how the node fares; logged when it changes."""
        if (state, text) != (self.state, self.last_error) and text:
            self.say(text)
        self.state, self.last_error = state, text or self.last_error

    def follow(self, *parts: Health) -> None:
        """Report on the parts that a driver is made of: the first that is at fault, or the last."""
        at_fault = [part for part in parts if part.state != "ok"]
        told = [part for part in at_fault or parts if part.message]
        text = told[0].message if told else ""
        self.report("fault" if at_fault else "running", text)

    def reject(self, cause: str) -> None:
        """Count a sample that was refused, by cause."""
        self.rejected[cause] += 1


class CalibrationInUse(NamedTuple):
    """What a node goes by: parameters by name, and the file that it takes at its start, or ""."""

    values: dict[str, Any]
    file: str = ""


class Node(Generic[P]):
    """Base of all nodes: `class Odometry(Node[OdometryParams])`.

    `State`, if a node names one, is the dataclass in which it hands itself over to its successor
    after a crash; `save` and `resume` carry it.
    """

    State: ClassVar[type | None] = None

    def __init__(self, params: P, context: Context | None = None) -> None:
        self.params = params
        self.context = context or Context()
        self.senders: dict[str, Sender[Any]] = {name: Sender() for name in self.outputs()}
        # An entry in the instance's own dict spares each send the way through Output.__get__.
        self.__dict__.update(self.senders)
        self.setup()

    def setup(self) -> None:
        """Make what the handlers need; called before the first sample, and once more after `close`
        if `resume` fails.
        """

    def close(self) -> None:
        """Give back what `setup` took; called after the last sample."""

    def save(self) -> Any:
        """This node's `State` now, or None while there is nothing worth keeping."""
        return None

    def resume(self, state: Any) -> None:
        """Go on from the `State` of a predecessor that died."""

    def calibrate(self, data: bytes) -> CalibrationInUse:
        """Go by a calibration file from now on, for those that have any use for one.

        `data` is what the file holds, or nothing: then all stays as it is. The answer is what was
        in use before. ValueError, with the node as it was, if the file makes no sense.
        """
        raise NotImplementedError

    @classmethod
    def inputs(cls) -> dict[str, Input[Any]]:
        """Input ports by name."""
        return _ports(cls, Input)

    @classmethod
    def outputs(cls) -> dict[str, Output[Any]]:
        """Output ports by name."""
        return _ports(cls, Output)

    @classmethod
    def params_type(cls) -> type:
        """The dataclass between the brackets of `Node[...]`."""
        for parent in cls.__mro__:
            for base in parent.__dict__.get("__orig_bases__", ()):
                origin, args = get_origin(base), get_args(base)
                is_node = isinstance(origin, type) and issubclass(origin, Node)
                if is_node and args and isinstance(args[0], type):
                    return args[0]
        raise TypeError(f"{cls.__name__} does not say what its params are: write Node[Params]")


class Paced(Protocol):
    """Params of a driver: they say how often it ticks."""

    @property
    def rate(self) -> float: ...


D = TypeVar("D", bound=Paced)


class Driver(Node[D]):
    """A node that ticks by the clock, `params.rate` times a second: a source of samples."""

    def tick(self, stamp: int) -> None:  # noqa: ARG002 - what subclasses take
        """Read the device and send; `stamp` is the time now, in ns since the UNIX epoch."""
        raise TypeError(f"{type(self).__name__} has no tick method")


def _ports(cls: type, kind: type[Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for parent in reversed(cls.__mro__):
        found |= {name: port for name, port in vars(parent).items() if isinstance(port, kind)}
    return found
