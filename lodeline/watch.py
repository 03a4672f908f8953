"""What tools see of a running pipeline: its keys, its status messages, its samples."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from typing import Any, Self

from lodeline.bus import BusError, Publisher
from lodeline.params import closest, nearest
from lodeline.run_folder import Key, Running, running
from lodeline.sessions import Client
from lodeline_msgs import DecodeError, NodeStatus, unpack

PATIENCE_S = 2.0
"""After this long without an answer, a tool says what it waits for."""
CALIBRATING = "@calibrating"
"""Key below the pipeline's name on which a calibration shows how far it is, in JSON."""
SILENT_S = 3.0
"""A node that has said nothing of itself for so long is shown as silent."""
FIRST_LOOK_S = 0.02
"""How often `statuses` looks whether the first ones are there."""
LOOK_S = 1.0
"""How often a tool that waits looks whether the pipeline still runs."""


def parted(status: NodeStatus) -> tuple[dict[str, int], dict[str, int]]:
    """What a node counts as refused: ticks that a driver missed or was late for, which are no
    samples, and samples, both by cause.
    """
    refused = dict(status.rejected)
    return {cause: refused.pop(cause, 0) for cause in ("missed tick", "late tick")}, refused


class NothingThereError(Exception):
    """Nothing runs, or runs no more, or no such key: exit code 4."""


def choose(name: str | None) -> Running:
    """The one pipeline that runs on this machine, or the one of that name."""
    found = running(name)
    if not found and name:
        others = [item.manifest.name for item in running()]
        raise NothingThereError(f"no pipeline {name!r} runs here{nearest(name, others)}")
    if not found:
        raise NothingThereError("no pipeline runs here: start one with `lodeline up`")
    names = sorted({item.manifest.name for item in found})
    if len(names) > 1:
        raise NothingThereError(f"several pipelines run: choose by --name ({', '.join(names)})")
    return found[0]


def meant_key(name: str, keys: Collection[str], where: str) -> str:
    """The one of some keys that a name means: the whole of it, or the end of just one."""
    meant = [key for key in keys if key == name] or [
        key for key in keys if key.endswith(f"/{name}")
    ]
    if len(meant) == 1:
        return meant[0]
    if meant:
        raise NothingThereError(f"{name!r} may be {' or '.join(meant)}")
    ends = {key.rpartition("/")[2]: key for key in keys}
    like = closest(name, [*keys, *ends])
    advice = nearest(name, keys) if like is None else f", did you mean {ends.get(like, like)!r}?"
    raise NothingThereError(f"no key {name!r} in {where}{advice}")


class Watch:
    """A tool's view of one pipeline: `with Watch(choose(name)) as watch: ...`."""

    def __init__(self, target: Running) -> None:
        self.manifest = target.manifest
        self._target = target
        try:
            self._client = Client(target.folder)
        except BusError:
            raise NothingThereError(
                f"{self.manifest.name} runs, but its supervisor, pid {self.manifest.pid}, is silent"
            ) from None
        self._lock = threading.Lock()
        self._statuses: dict[str, NodeStatus] = {}
        self._came: dict[str, float] = {}
        self._collect: Callable[[Callable[[str, bytes, str], None]], None] | None = None
        self._silent: list[str] = []

    def keys(self) -> dict[str, Key]:
        """Keys of the pipeline without its name, and what is known of each."""
        return self._target.keys()

    def all_keys(self) -> dict[str, Key]:
        """The same, and the key on which each node reports on itself."""
        status = {f"status/{node}": Key(NodeStatus.__name__, node) for node in self.manifest.nodes}
        return self.keys() | status

    def full_key(self, name: str, keys: Collection[str] | None = None) -> str:
        """The one of `keys` (default: all) meant by a name: whole, without the pipeline, or the
        end of just one.
        """
        pipeline = self.manifest.name
        short = name.removeprefix(f"{pipeline}/")
        return f"{pipeline}/{meant_key(short, self.all_keys() if keys is None else keys, pipeline)}"

    def still_there(self) -> bool:
        """Whether the pipeline still runs under the same supervisor."""
        return self._target.goes_on()

    def ticks(self, period: float, sooner: threading.Event | None = None) -> Iterator[None]:
        """Yields now and every `period` seconds, or when `sooner` is set; NothingThereError when
        the pipeline is gone.
        """
        due = looked = time.monotonic()
        while True:
            yield
            due = max(due + period, now := time.monotonic())
            if sooner is None:
                time.sleep(due - now)
            elif sooner.wait(due - now):
                due = time.monotonic()
            if due - looked >= LOOK_S:
                looked = due
                if not self.still_there():
                    raise NothingThereError(f"{self.manifest.name} runs no more")

    def statuses(self, timeout: float) -> dict[str, NodeStatus]:
        """The newest status of each node, as soon as every node of the pipeline has one.

        After `timeout` seconds it is those that there are, and a word about the others.
        """
        end = time.monotonic() + timeout
        with self._lock:
            if self._collect is None:
                self._collect = self._client.collect_kept(f"{self.manifest.name}/status/*")
            while True:
                self._collect(self._on_status)
                silent = [node for node in self.manifest.nodes if node not in self._statuses]
                if not silent or time.monotonic() >= end:
                    break
                time.sleep(FIRST_LOOK_S)
            statuses = dict(self._statuses)
        if silent and silent != self._silent:
            print(f"waiting for a status of {', '.join(silent)}", file=sys.stderr, flush=True)
        self._silent = silent
        return {node: statuses[node] for node in self.manifest.nodes if node in statuses}

    def _on_status(self, _key: str, data: bytes, _encoding: str) -> None:
        try:
            status = unpack(data, NodeStatus)
        except DecodeError as error:
            print(f"a status that cannot be read: {error}", file=sys.stderr)
            return
        known = self._statuses.get(status.node)
        # The time that a node goes by may be set back: then its numbering tells.
        later = known is not None and (known.pid, known.seq) < (status.pid, status.seq)
        if known is None or later or status.stamp >= known.stamp:
            self._statuses[status.node] = status
            self._came[status.node] = time.monotonic()

    def silence(self) -> dict[str, float]:
        """How long ago [s] the newest status of each node was collected by `statuses`."""
        now = time.monotonic()
        with self._lock:
            return {node: now - came for node, came in self._came.items()}

    def processes(self) -> dict[str, dict[str, Any]]:
        """What the supervisors say of the process of each node, by node."""
        reports = self.ask("@ps")
        return {
            node: process
            for report in reports.values()
            for process in report["processes"]
            for node in process["nodes"]
        }

    def clock_bars(self) -> dict[frozenset[str], float]:
        """How well [s] the clocks of two hosts are known to each other, by pair of hosts.

        A pair of which nothing is known is left out.
        """
        bars: dict[frozenset[str], float] = {}
        if len(set(self.manifest.places.values())) < 2:
            return bars
        for word, report in self.ask("@ps").items():
            hosts = word.split("+")  # one machine, one clock
            bars |= {frozenset((a, b)): 0.0 for a in hosts for b in hosts if a != b}
            for link in report["links"]:
                if link["clock"]:
                    bars[frozenset((word, link["host"]))] = link["clock"]["error"]
        return bars

    def ask(self, what: str, rest: str = "", data: bytes = b"") -> dict[str, Any]:
        """Answers to `NAME/WHAT/HOST` and the rest, asked with `data`, by host."""
        answers = self._client.ask(f"{self.manifest.name}/{what}/*{rest}", data=data)
        return {key.split("/")[2]: json.loads(data) for key, data in answers}

    def ask_behind(self, key: str, data: bytes, timeout: float) -> list[bytes]:
        """Answers to a query of a full key that holds up no sample, at most `timeout` s later."""
        return [answer for _, answer in self._client.ask(key, timeout, data, behind=True)]

    def subscribe(self, key: str, queue: int, take: Callable[[str, bytes, str], None]) -> None:
        """Call `take(key, data, encoding)`, in a thread, for each sample of a full key."""
        self._client.subscribe(key, queue, take)

    def publisher(self, key: str, encoding: str) -> Publisher:
        """A way to send on a full key."""
        return self._client.publisher(key, encoding)

    def follow(
        self, key: str, take: Callable[[bytes, str], bool], timeout: float | None = None
    ) -> bool:
        """Give each sample of a full key to `take` (data, encoding) until it returns False.

        Says on standard error what it waits for. False if `timeout` seconds pass first;
        NothingThereError if the pipeline ends.
        """
        done = threading.Event()
        first = threading.Event()
        failures: list[BaseException] = []

        def on_sample(_key: str, data: bytes, encoding: str) -> None:
            first.set()
            if done.is_set():
                return
            try:
                more = take(data, encoding)
            except BaseException as error:
                failures.append(error)
                more = False
            if not more:
                done.set()

        self.subscribe(key, 256, on_sample)
        begun = time.monotonic()
        end = float("inf") if timeout is None else begun + timeout
        if not first.wait(min(PATIENCE_S, end - begun)):
            print(f"waiting for a sample of {key}", file=sys.stderr, flush=True)
        look = time.monotonic() + LOOK_S
        while not done.wait(max(0.0, min(look, end) - time.monotonic())):
            if time.monotonic() >= end:
                return False
            if not self.still_there():
                raise NothingThereError(f"{self.manifest.name} runs no more")
            look = time.monotonic() + LOOK_S
        if failures:
            raise failures[0]
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()
