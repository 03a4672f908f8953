"""A link that takes less than is sent: known by what waits for it, and what to do about it.

Where TCP holds something back at every look, the link takes no more. Over TLS that matters most:
there some hundred kilobytes wait below zenoh, which are seconds of old samples.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from lodeline_msgs import DecodeError, NodeStatus, unpack

LOOKS = 15
"""Slow is a link for which something was held back at so many looks in a row, which are 3 s."""
LONGEST_PAUSE_S = 1.0
"""Looks further apart are not in a row."""
AGAIN_S = 60.0
FRESH_S = 5.0
RATES = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)
"""What is proposed [Hz]: the first that fits."""
LEAST_HZ = 1.0
SHARE = 0.6
"""The part of what a link takes that samples may have; headers and status have the rest."""
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

    `remedy(takes)` [B/s] is asked whenever it is told.
    """

    def __init__(self, event: Callable[[str], None], remedy: Callable[[float], str]) -> None:
        self._event = event
        self._remedy = remedy
        self._looks: dict[str, deque[tuple[float, bool, int]]] = {}
        self._told: dict[str, tuple[float, str]] = {}
        self._last: tuple[float, Slow] | None = None

    def look(self, who: str, now: float, held_back: bool, confirmed: int) -> None:
        """Whether at `now` [s] something waited that could not go, and bytes confirmed in all."""
        if who not in self._looks:
            self._forget(now)
        looks = self._looks.setdefault(who, deque(maxlen=LOOKS))
        if looks and (confirmed < looks[-1][2] or now - looks[-1][0] > LONGEST_PAUSE_S):
            looks.clear()  # another connection
        looks.append((now, held_back, confirmed))
        if len(looks) < LOOKS or not all(held for _, held, _ in looks):
            return
        (began, _, before), (ended, _, after) = looks[0], looks[-1]
        if after == before:
            return  # cut, not slow
        told, remedy = self._told.get(who, (-AGAIN_S, ""))
        again = now - told >= AGAIN_S
        takes = (after - before) / (ended - began)
        if again:
            remedy = self._remedy(takes)
            self._told[who] = now, remedy
        slow = Slow(who, takes, remedy)
        self._last = now, slow
        if again:
            self._event(str(slow))

    def _forget(self, now: float) -> None:
        """Links that are no more: who comes back has another port."""
        for who in [who for who, looks in self._looks.items() if now - looks[-1][0] > AGAIN_S]:
            del self._looks[who]
            self._told.pop(who, None)

    def current(self, now: float) -> Slow | None:
        """The link that is slow now [s]."""
        last = self._last  # another thread may replace it meanwhile
        return last[1] if last and now - last[0] < FRESH_S else None


class Advice:
    """What to write in the pipeline file of a host, by what its nodes say that they send.

    `collect_kept` is that of the hub; `thinned` are the full keys of `link_rate` [Hz], `crossing`
    those that nodes of other hosts read. What tools there watch is not known here: where no node
    reads anything, all that is sent is named.
    """

    def __init__(
        self,
        collect_kept: CollectKept,
        name: str,
        host: str,
        thinned: Mapping[str, float],
        crossing: Collection[str],
    ) -> None:
        self._collect_kept = collect_kept
        self._name = name
        self._host = host
        self._thinned = thinned
        self._crossing = crossing
        self._collect: Collect | None = None
        self._sent: dict[str, tuple[float, float]] = {}

    def __call__(self, takes: float) -> str:
        """In words, for a link that takes so much [B/s]."""
        if self._collect is None:
            self._collect = self._collect_kept(f"{self._name}/status/*")
            time.sleep(ANSWER_S)
        self._collect(self._take)
        sent = {key: flow for key, flow in self._sent.items() if key in self._crossing}
        rates = fitting(sent or self._sent, SHARE * takes)
        if not rates:
            return "let fewer keys be watched over it"
        text = ", ".join(f"{key.partition('/')[2]}: {rate:g}" for key, rate in rates.items())
        words = f"`link_rate: {{{text}}}`"
        return f"write {words}" if sent else f"write what is watched there of {words}"

    def _take(self, _key: str, data: bytes, _encoding: str) -> None:
        try:
            status = unpack(data, NodeStatus)
        except DecodeError:
            return
        if status.host != self._host:
            return
        for key, rate in status.rates.items():
            share = min(1.0, self._thinned.get(key, rate) / rate) if rate else 0.0
            self._sent[key] = share * rate, share * status.bandwidths[key]


def fitting(sent: Mapping[str, tuple[float, float]], most: float) -> dict[str, float]:
    """Which keys to thin to how much [Hz], so that all of `sent` ([Hz], [B/s] by key) are `most`
    [B/s] together; those that cost most come first.
    """
    limit = next((rate for rate in RATES if _thinned(sent, rate) <= most), LEAST_HZ)
    fast = [key for key, (rate, _) in sent.items() if rate > 1.1 * limit]
    return dict.fromkeys(sorted(fast, key=lambda key: -sent[key][1]), limit)


def _thinned(sent: Mapping[str, tuple[float, float]], limit: float) -> float:
    return sum(size * min(1.0, limit / rate) for rate, size in sent.values() if rate)
