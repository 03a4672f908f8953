"""The other hosts of a pipeline as this one sees them: who is there, and whether they fit."""

from __future__ import annotations

import json
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from lodeline.clock import HostClock
from lodeline.hosts.offset import Offset, better, measured
from lodeline.hosts.share import Share, claimed, differences, taken

LOOK_S = 0.7
"""How long a start looks for another machine that runs the same share."""
ASK_S = 1.0
ASK_AGAIN_S = 0.05
PING_S = 2.0
PINGS = 4


class Bus(Protocol):
    """What is asked of the hub."""

    def serve(self, key: str, answer: Callable[[], bytes]) -> None: ...

    def claim(self, key: str) -> None: ...

    def watch_claims(self, key: str, take: Callable[[str, bool], None]) -> None: ...

    def ask(self, key: str, timeout: float = ...) -> list[tuple[str, bytes]]: ...


@dataclass(slots=True)
class Neighbour:
    """Another claim: `since` [s, monotonic] it came, or went if it is not there."""

    host: str
    there: bool
    since: float
    share: Share | None = None
    faults: list[str] = field(default_factory=list)
    offset: Offset | None = None


class Neighbours:
    """Follows the claims on a pipeline's name; `event(text)` tells what is worth a log line.

    `others` are the hosts that the pipeline file names besides this one; `clock` is what other
    hosts get when they ask for the time here.
    """

    def __init__(
        self,
        bus: Bus,
        share: Share,
        others: tuple[str, ...],
        event: Callable[[str], None],
        clock: HostClock,
    ) -> None:
        self._bus = bus
        self._clock = clock
        self.on_offset: Callable[[str, Offset], None] = lambda _host, _offset: None
        self._share = share
        self._event = event
        now = time.monotonic()
        self._lock = threading.Lock()
        self._known: dict[str, Neighbour] = {host: Neighbour(host, False, now) for host in others}
        self._rivals: dict[str, Neighbour] = {}
        self._claims: queue.SimpleQueue[tuple[str, str, bool] | None] = queue.SimpleQueue()
        self._rival_came = threading.Event()
        self._rival_known = threading.Event()
        self._started = False
        bus.watch_claims(f"{share.name}/@claim/**", self._on_claim)
        self._thread = threading.Thread(target=self._follow, name="neighbours", daemon=True)
        self._thread.start()

    def rival(self, patience: float = LOOK_S) -> str | None:
        """Why this share must not start, after looking around for `patience` seconds."""
        if not self._rival_came.wait(patience):
            return None
        self._rival_known.wait(2 * ASK_S)
        with self._lock:
            return next((rival.faults[0] for rival in self._rivals.values()), None)

    def claim(self) -> None:
        """From now on this share is ours, for all to see."""
        self._started = True
        self._bus.serve(self._share.key, self._share.to_json)
        self._bus.serve(self._clock_key(self._share), self._time)
        self._bus.claim(self._share.claim)

    def describe(self) -> list[dict[str, Any]]:
        """Each other host as plain values, for `lodeline ps`; from any thread."""
        now = time.monotonic()
        with self._lock:
            seen = [*self._known.values(), *self._rivals.values()]
            return [_described(each, now) for each in sorted(seen, key=lambda item: item.host)]

    def close(self) -> None:
        """Follow no more."""
        self._claims.put(None)
        self._thread.join(ASK_S + 0.5)

    def _clock_key(self, share: Share) -> str:
        return f"{share.name}/@clock/{share.host}/{share.run}"

    def _time(self) -> bytes:
        """Our time."""
        return json.dumps(self._clock.now()).encode()

    def _on_claim(self, key: str, there: bool) -> None:
        host, run = claimed(key)
        if run == self._share.run:
            return
        if there and host == self._share.host:
            self._rival_came.set()
        self._claims.put((host, run, there))

    def _follow(self) -> None:
        next_ping = time.monotonic()
        while True:
            try:
                item = self._claims.get(timeout=max(0.0, next_ping - time.monotonic()))
            except queue.Empty:
                next_ping = time.monotonic() + PING_S
                self._ping_all()
                continue
            if item is None:
                return
            host, run, there = item
            if host == self._share.host:
                self._on_rival(host, run, there)
            elif there:
                self._come(host, run)
            else:
                self._go(host, run)

    def _ping_all(self) -> None:
        with self._lock:
            seen = [item for item in self._known.values() if item.there and item.share]
        for neighbour in seen:
            for _ in range(PINGS):
                if not self._ping(neighbour):
                    break
            if neighbour.offset is not None:
                self.on_offset(neighbour.host, neighbour.offset)

    def _ping(self, neighbour: Neighbour) -> bool:
        """One question for the time; whether it was answered."""
        assert neighbour.share is not None
        sent = self._clock.now()
        answers = self._bus.ask(self._clock_key(neighbour.share), ASK_S)
        received, now = self._clock.now(), time.monotonic_ns()
        try:
            there = int(json.loads(answers[0][1]))
        except (IndexError, ValueError, TypeError, OverflowError):
            return False  # none, or one that is no time
        found = measured(sent, there, received, now)
        neighbour.offset = better(neighbour.offset, found, now)
        return True

    def _ask(self, host: str, run: str) -> Share | None:
        """Their share; the way to it may be known a moment later than the claim."""
        end = time.monotonic() + ASK_S
        while time.monotonic() < end:
            for _key, data in self._bus.ask(f"{self._share.name}/@share/{host}/{run}", ASK_S):
                try:
                    return Share.from_json(data)
                except (ValueError, KeyError, TypeError):
                    return None
            time.sleep(ASK_AGAIN_S)
        return None

    def _on_rival(self, host: str, run: str, there: bool) -> None:
        if not there:
            with self._lock:
                self._rivals.pop(run, None)
            return
        share = self._ask(host, run)
        text = taken(self._share, share)
        with self._lock:
            self._rivals[run] = Neighbour(host, True, time.monotonic(), share, [text])
        self._rival_known.set()
        if self._started:
            self._event(text)

    def _come(self, host: str, run: str) -> None:
        share = self._ask(host, run)
        faults = [f"{host} runs another version of Lodeline"]
        if share is not None:
            faults = differences(self._share, share)
        with self._lock:
            self._known[host] = Neighbour(host, True, time.monotonic(), share, faults)
        self._ping_all()
        machine = f" on machine {share.machine}" if share else ""
        self._event(f"LINKED {host}{machine}")
        for fault in faults:
            self._event(f"MISMATCH {fault}")

    def _go(self, host: str, run: str) -> None:
        with self._lock:
            known = self._known.get(host)
            if known is None or (known.share is not None and known.share.run != run):
                return  # its successor is here already
            self._known[host] = Neighbour(host, False, time.monotonic(), known.share)
        self._event(f"LINK_LOST {host}: gone, or the network between is")


def _described(neighbour: Neighbour, now: float) -> dict[str, Any]:
    share, offset = neighbour.share, neighbour.offset
    clock = None
    if offset is not None and neighbour.there:
        bar = offset.aged(time.monotonic_ns())
        clock = {"offset": round(offset.seconds, 6), "error": round(bar, 6)}
    return {
        "host": neighbour.host,
        "state": "linked" if neighbour.there else ("lost" if share else "waiting"),
        "seconds": round(now - neighbour.since, 3),
        "machine": share.machine if share else None,
        "digest": share.digest if share else None,
        "clock": clock,
        "faults": list(neighbour.faults),
    }
