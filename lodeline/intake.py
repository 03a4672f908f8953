"""How samples get from the bus to the handlers of a process: the short way, or through a ring.

A hop between processes costs what it takes to wake its threads. So a sample is handled in the very
thread that read it from the bus as long as this holds nobody up: no handler runs, nothing of its
edge waits, its last handler was quick, and the bus has had as much time for itself since. Else it
waits in the ring of its edge, which keeps the newest, for the one thread that empties them all.

For edges between nodes of one pipeline: a flood from elsewhere would keep the bus from all others.
"""

from __future__ import annotations

import threading
from collections import deque
from queue import SimpleQueue
from time import monotonic
from typing import Any

from lodeline.inlet import Inlet

QUICK_S = 0.001
"""An edge whose handler took longer is left to the other thread until it is quick again."""


class Intake:
    """The edges into one process; `lock` keeps its handlers apart."""

    def __init__(self, lock: threading.RLock) -> None:
        self.lock = lock
        self.turns: SimpleQueue[Edge] = SimpleQueue()
        self.bus_free_at = 0.0
        self.ended = False  # by a handler that would end its thread, which is not ours to end
        self._thread = threading.Thread(target=self._run, name="intake", daemon=True)
        self._thread.start()

    def alive(self) -> bool:
        """Whether somebody cares for what waits."""
        return self._thread.is_alive() and not self.ended

    def _run(self) -> None:
        next_turn, lock = self.turns.get, self.lock
        while True:
            edge = next_turn()
            with lock:
                edge.take_waiting()


class Edge:
    """The way to one inlet; at most `queue` samples wait on it, the oldest go."""

    __slots__ = ("_asked", "_inlet", "_intake", "_quick", "_room", "_taken", "_waiting")

    def __init__(self, intake: Intake, inlet: Inlet[Any], queue: int) -> None:
        self._intake = intake
        self._inlet = inlet
        self._waiting: deque[tuple[bytes, str]] = deque(maxlen=queue)
        self._room = queue
        self._asked = self._taken = 0  # turns: the first counted by the bus, the second by Intake
        self._quick = False

    def arrive(self, source: str, data: bytes) -> None:
        """A sample, in a thread of the bus, for which it waits for nothing."""
        intake = self._intake
        # Whether a stranger may send is asked of the bus: that would wait for this very thread.
        if self._quick and source == self._inlet.source and intake.lock.acquire(blocking=False):
            try:
                if not self._waiting and (began := monotonic()) >= intake.bus_free_at:
                    self._inlet.take(data, source)
                    ended = monotonic()
                    self._quick = ended - began < QUICK_S
                    intake.bus_free_at = ended + (ended - began)
                    return
            except BaseException:
                intake.ended = True
                raise
            finally:
                intake.lock.release()
        self._waiting.append((data, source))
        # One that pushed an older one out has its turn: there is no end to those of a slow handler.
        if self._asked - self._taken < self._room:
            self._asked += 1
            intake.turns.put(self)

    def take_waiting(self) -> None:
        """The oldest that waits, if any still does; with the lock held, so that none overtakes."""
        self._taken += 1  # before the sample goes: what arrives now asks for a turn of its own
        if self._waiting:
            began = monotonic()
            self._inlet.take(*self._waiting.popleft())
            self._quick = monotonic() - began < QUICK_S
