"""Where samples enter a process: checked, counted, refused if they are old or foreign."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from lodeline.clock import Clock
from lodeline.health import Complaint
from lodeline_msgs import DecodeError, Message, unpacker_of

M = TypeVar("M", bound=Message)

MOST_LOST = 1_000_000
"""A number further ahead than this was not lost on the way: somebody counts differently."""
MOST_HELD = 4096
ASK_AGAIN_NS = 1_000_000_000


def anybody(_source: str) -> bool:
    """For a key that comes from outside the pipeline: whoever sends it may."""
    return True


class Inlet(Generic[M]):
    """One edge into one port.

    A number that was seen or overtaken is refused as `duplicate` or `reordered`, unless another
    process sends now, or the sample was measured later than all before it: then its sender was
    restarted and counts anew. With a `max_age` in seconds, samples older than that are late, and
    those that lie as far ahead are refused: one of them would make all that follow look old.
    `may_send(source)` says whether a sender is the one that the pipeline file names.
    """

    def __init__(
        self,
        key: str,
        message: type[M],
        max_age: float | None,
        clock: Clock,
        reject: Callable[[str], None],
        deliver: Callable[[M], None],
        may_send: Callable[[str], bool] = anybody,
    ) -> None:
        self.key = key
        self.unpack = unpacker_of(message)
        self.received = 0
        self.lost = 0
        self.late = 0
        self.last_error = ""
        self._ages: list[float] = []
        self._limit = None if max_age is None else int(max_age * 1e9)
        self._clock = clock
        self._reject = reject
        self._deliver = deliver
        self._may_send = may_send
        self._held: list[tuple[bytes, str]] | None = None
        self.source = ""
        self._stranger: str | None = None
        self._ask_again = 0
        self._last_seq = -1
        self._last_stamp = 0
        self._refused = 0
        self._late_before = 0

    def take(self, data: bytes, source: str = "", missed: bool = False) -> None:
        """One sample from the bus, sent by the session `source`; whatever it is, this returns.

        One that a predecessor of the node `missed` may be of any age.
        """
        if self._held is not None:
            if len(self._held) < MOST_HELD:
                self._held.append((data, source))
            return
        if source != self.source and not self._changes_hands(source):
            return
        try:
            message = self.unpack(data)
        except DecodeError as error:
            self._refuse(error.cause, str(error))
            return
        stamp, limit = message.stamp, self._limit
        self._clock.saw(stamp)
        age = self._clock.now() - stamp
        if limit is not None and age < -limit:
            self._refuse("ahead", f"stamped {-age * 1e-9:.3g} s ahead of now")
            return
        if not self._in_order(message.seq, stamp):
            return
        if not missed:
            self._ages.append(age * 1e-9)
            if limit is not None and age > limit:
                self.late += 1
                return
        self.received += 1
        self._deliver(message)

    def hold(self) -> None:
        """Let samples wait from now on."""
        self._held = []

    def let_go(self) -> list[tuple[bytes, str]]:
        """The samples that waited and their senders; from now on they are taken."""
        held, self._held = self._held or [], None
        return held

    @property
    def waiting(self) -> bool:
        """Whether samples wait."""
        return bool(self._held)

    @property
    def newest(self) -> int:
        """The stamp [ns] of the last sample that was in order, 0 if there was none."""
        return self._last_stamp

    def _changes_hands(self, source: str) -> bool:
        """Whether samples may come from another process than before; its numbers start anew."""
        now = self._clock.now()
        if source == self._stranger and now < self._ask_again:
            allowed = False
        else:
            allowed = self._may_send(source)
        if not allowed:
            self._stranger, self._ask_again = source, now + ASK_AGAIN_NS
            self._refuse("foreign", f"from {source or 'a nameless sender'}, not the node's process")
            return False
        self.source = source
        self._last_seq = -1
        return True

    def _in_order(self, seq: int, stamp: int) -> bool:
        last = self._last_seq
        if seq <= last and stamp <= self._last_stamp:
            self._refuse("duplicate" if seq == last else "reordered", f"number {seq} after {last}")
            return False
        missing = seq - last - 1
        if last >= 0 and 0 < missing <= MOST_LOST:
            self.lost += missing
        self._last_seq = seq
        self._last_stamp = stamp
        return True

    def _refuse(self, cause: str, why: str) -> None:
        self._refused += 1
        self._reject(cause)
        self.last_error = f"{self.key}: {cause}: {why}"

    def drain_ages(self) -> list[float]:
        """Ages on arrival [s] since the last call, sorted."""
        ages, self._ages = self._ages, []
        return sorted(ages)

    def complaints(self) -> list[Complaint]:
        """What is to be said of the samples since the last call."""
        refused, self._refused = self._refused, 0
        late, self._late_before = self.late - self._late_before, self.late
        found = []
        if refused:
            text = f"{refused} refused, the last as {self.last_error.removeprefix(self.key)[2:]}"
            found.append(Complaint("degraded", f"REFUSED {self.key}", text))
        if late:
            found.append(Complaint("degraded", f"LATE {self.key}", f"{late} too old to use"))
        return found


def counts(inlets: list[Inlet[Any]], name: str) -> dict[str, int]:
    """A counter of each inlet by key, edges to the same key added up."""
    total: Counter[str] = Counter()
    for inlet in inlets:
        total[inlet.key] += getattr(inlet, name)
    return dict(total)
