"""The bus of a run: the hub of this machine, its link to other hosts, and what ails that."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from lodeline.bus import overhear_links, several_threads
from lodeline.hosts.links import Link
from lodeline.hosts.refusals import Refusals
from lodeline.hosts.slowness import Advice, Slowness
from lodeline.pipeline.model import Pipeline
from lodeline.sessions import Gateway, Hub


class Wires:
    """`hub` is there for all; without ends of `link` no port is opened, nothing is connected."""

    def __init__(
        self, folder: Path, link: Link, pipeline: Pipeline, host: str, event: Callable[[str], None]
    ) -> None:
        """`event(text)` is told of refused and slow links; `host` is what others know us by."""
        self._refusals = Refusals(event)
        if link.ends:
            overhear_links(self._refusals.take)
        with several_threads() if link.ends else nullcontext():
            self.hub = Hub(folder)
        elsewhere = pipeline.read_elsewhere(host)
        advice = Advice(self.hub.collect_kept, pipeline.name, host, pipeline.link_rate, elsewhere)
        self._slowness = Slowness(event, advice)
        self._gateway = Gateway(folder, link, self._slowness.look) if link.ends else None

    def ails(self) -> dict[str, Any]:
        """What is wrong with the link now, as plain values; None under `refused` and `slow`: no."""
        refused, slow = self._refusals.current(), self._slowness.current(time.monotonic())
        return {"refused": refused and refused._asdict(), "slow": slow and str(slow)}

    def close(self, timeout: float) -> None:
        """Leave the others, then close the hub, each within `timeout` [s]."""
        if self._gateway is not None:
            self._gateway.close(timeout=timeout)
        self.hub.close(timeout=timeout)
