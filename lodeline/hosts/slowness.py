"""A link that takes less than is sent: known by what waits for it, and what to do about it.

Where TCP holds something back at every look, the link takes no more. Over TLS that matters most:
there some hundred kilobytes wait below zenoh, which are seconds of old samples.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

from lodeline_msgs import DecodeError, NodeStatus, unpack

LOOKS = 15
"""Slow is a link for which something was held back at so many looks in a row, which are 3 s."""
AGAIN_S = 60.0
FRESH_S = 5.0
VIEW_HZ = 20.0
"""What a person who watches needs of any key."""
MOST_KEYS = 3
ANSWER_S = 0.2

Collect = Callable[[Callable[[str, bytes, str], None]], None]
CollectKept = Callable[[str], Collect]


class Slow(NamedTuple):
    """Who is at the other end of a slow link, what it takes [B/s], and what to do."""

    who: str
    takes: float
    remedy: str

    def __str__(self) -> str:
        return (
            f"LINK_SLOW {self.who}: it takes {self.takes / 1e3:.0f} kB/s and more is sent, samples "
            f"get old or lost: {self.remedy}"
        )


class Slowness:
    """Collects looks at links by `look`, in one thread; `event(text)` tells of each each minute.

    `remedy()` is asked whenever it is told.
    """

    def __init__(self, event: Callable[[str], None], remedy: Callable[[], str]) -> None:
        self._event = event
        self._remedy = remedy
        self._looks: dict[str, deque[tuple[float, bool, int]]] = {}
        self._told: dict[str, tuple[float, str]] = {}
        self._last: tuple[float, Slow] | None = None

    def look(self, who: str, now: float, held_back: bool, confirmed: int) -> None:
        """Whether at `now` [s] something waited that could not go, and bytes confirmed in all."""
        looks = self._looks.setdefault(who, deque(maxlen=LOOKS))
        looks.append((now, held_back, confirmed))
        if len(looks) < LOOKS or not all(held for _, held, _ in looks):
            return
        (began, _, before), (ended, _, after) = looks[0], looks[-1]
        if after == before:
            return  # cut, not slow
        told, remedy = self._told.get(who, (-AGAIN_S, ""))
        again = now - told >= AGAIN_S
        if again:
            remedy = self._remedy()
            self._told[who] = now, remedy
        slow = Slow(who, (after - before) / (ended - began), remedy)
        self._last = now, slow
        if again:
            self._event(str(slow))

    def current(self, now: float) -> Slow | None:
        """The link that is slow now [s]."""
        last = self._last  # another thread may replace it meanwhile
        return last[1] if last and now - last[0] < FRESH_S else None


class Advice:
    """What to write in the pipeline file of a host, by what its nodes say that they send.

    `collect_kept` is that of the hub; `thinned` are the full keys of `link_rate` [Hz].
    """

    def __init__(
        self, collect_kept: CollectKept, name: str, host: str, thinned: Mapping[str, float]
    ) -> None:
        self._collect_kept = collect_kept
        self._name = name
        self._host = host
        self._thinned = thinned
        self._collect: Collect | None = None
        self._sizes: dict[str, float] = {}

    def __call__(self) -> str:
        if self._collect is None:
            self._collect = self._collect_kept(f"{self._name}/status/*")
            time.sleep(ANSWER_S)
        self._collect(self._take)
        largest = sorted(self._sizes, key=lambda key: -self._sizes[key])[:MOST_KEYS]
        if not largest:
            return "let fewer keys be watched over it"
        return f"write `link_rate: {{{', '.join(f'{key}: {VIEW_HZ:g}' for key in largest)}}}`"

    def _take(self, _key: str, data: bytes, _encoding: str) -> None:
        try:
            status = unpack(data, NodeStatus)
        except DecodeError:
            return
        for key, rate in status.rates.items():
            if status.host == self._host and rate > VIEW_HZ and key not in self._thinned:
                self._sizes[key.partition("/")[2]] = status.bandwidths[key]
