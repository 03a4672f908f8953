"""What tools see of a running pipeline: its keys, its status messages, its samples."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from lodeline.bus import BusError, Client
from lodeline.params import nearest
from lodeline.run_folder import Key, Running, running
from lodeline_msgs import DecodeError, NodeStatus, unpack

PATIENCE_S = 2.0
"""After this long without an answer, a tool says what it waits for."""


class NothingThereError(Exception):
    """Nothing runs, or no such key: exit code 4."""


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


class Watch:
    """A tool's view of one pipeline: `with Watch(choose(name)) as watch: ...`."""

    def __init__(self, target: Running) -> None:
        self.manifest = target.manifest
        self._target = target
        try:
            self._client = Client(target.folder)
        except BusError as error:
            raise NothingThereError(
                f"{self.manifest.name} runs, but its hub does not answer: {error}"
            ) from None
        self._changed = threading.Condition()
        self._statuses: dict[str, NodeStatus] = {}

    def keys(self) -> dict[str, Key]:
        """Keys of the pipeline without its name, and what is known of each."""
        return self._target.keys()

    def full_key(self, name: str) -> str:
        """The key meant by a name: whole, without the pipeline, or the end of just one key."""
        keys = self.keys()
        short = name.removeprefix(f"{self.manifest.name}/")
        meant = [key for key in keys if key == short] or [
            key for key in keys if key.endswith(f"/{short}")
        ]
        if len(meant) == 1:
            return f"{self.manifest.name}/{meant[0]}"
        if meant:
            raise NothingThereError(f"{name!r} may be {' or '.join(meant)}")
        raise NothingThereError(f"no key {name!r} in {self.manifest.name}{nearest(short, keys)}")

    def statuses(self, timeout: float) -> dict[str, NodeStatus]:
        """The newest status of each node, as soon as every node of the pipeline has one."""
        with self._changed:
            if not self._statuses:
                self._client.subscribe_kept(f"{self.manifest.name}/status/*", self._on_status)
            nodes = set(self.manifest.nodes)
            self._changed.wait_for(lambda: nodes <= set(self._statuses), timeout)
            return dict(self._statuses)

    def _on_status(self, _key: str, data: bytes, _encoding: str) -> None:
        try:
            status = unpack(data, NodeStatus)
        except DecodeError as error:
            print(f"a status that cannot be read: {error}", file=sys.stderr)
            return
        with self._changed:
            known = self._statuses.get(status.node)
            if known is None or status.stamp >= known.stamp:
                self._statuses[status.node] = status
            self._changed.notify_all()

    def follow(
        self, key: str, take: Callable[[bytes, str], bool], timeout: float | None = None
    ) -> bool:
        """Give each sample of a full key to `take` (data, encoding) until it returns False.

        Says on standard error what it waits for. False if `timeout` seconds pass first.
        """
        done = threading.Event()
        first = threading.Event()

        def on_sample(_key: str, data: bytes, encoding: str) -> None:
            first.set()
            if not done.is_set() and not take(data, encoding):
                done.set()

        self._client.subscribe(key, 256, on_sample)
        end = None if timeout is None else time.monotonic() + timeout
        patience = PATIENCE_S if end is None else min(PATIENCE_S, timeout or 0.0)
        if not first.wait(patience):
            print(f"waiting for a sample of {key}", file=sys.stderr, flush=True)
        while not done.wait(0.1):
            if end is not None and time.monotonic() >= end:
                return False
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._client.close()
