"""Filling the gaps of a live recording: senders keep what they sent of late, and are asked for it.

A gap shows in the numbers of the samples when a link that was cut, or a recorder that was frozen,
is back. It is asked for piece by piece, behind all that is sent meanwhile: small pieces where the
link is slow, and of each key in turn, because what is old is soon kept no more.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

import msgpack

from lodeline.recent import numbers, recent_key

ASK_S = 1.0
PATIENCE_S = 10.0
"""A sender that answers nothing for so long will not."""
MOST, LEAST = 16384, 1024
"""Bytes asked for at once; halved when no answer comes."""
AGAIN_S = 0.05

Ask = Callable[[str, bytes, float], list[bytes]]


@dataclass(slots=True)
class Gap:
    """The numbers `first` to `last` are missing of a key.

    `before` and `after` are stamp and log time [ns] of the samples between which they belong.
    """

    key: str
    first: int
    last: int
    before: tuple[int, int]
    after: tuple[int, int]

    def place(self, stamp: int, seq: int) -> int | None:
        """The log time [ns] of a sample had it come just as the one after the gap did.

        None if it does not belong here: a sender that was restarted has others of these numbers.
        """
        (begin, earliest), (end, latest) = self.before, self.after
        if not (self.first <= seq <= self.last and begin <= stamp <= end):
            return None
        return max(earliest, min(stamp + latest - end, latest - 1))


class Gaps(threading.Thread):
    """Asks for what is missing, in a thread, until `close`.

    `ask(key, question, seconds)` gives the answers of its sender; `take(gap, data)` the number of a
    sample that belongs in a gap and was written, else None.
    """

    def __init__(self, ask: Ask, take: Callable[[Gap, bytes], int | None], prefix: str) -> None:
        super().__init__(name="gaps", daemon=True)
        self._ask = ask
        self._take = take
        self._prefix = prefix
        self._open: deque[Gap] = deque()
        self._filled: Counter[str] = Counter()
        self._gone: Counter[str] = Counter()
        self._most = MOST
        self._changed = threading.Condition()
        self._answered = 0.0
        self._over = False

    def find(self, gap: Gap) -> None:
        """One more; from any thread."""
        with self._changed:
            if not self._open:
                self._answered = time.monotonic()
            self._open.append(gap)
            self._changed.notify_all()

    def settle(self, seconds: float) -> None:
        """Wait until nothing more can be had, but no longer than that."""
        with self._changed:
            self._changed.wait_for(lambda: not self._open, seconds)

    def news(self) -> list[str]:
        """What came of all gaps since the last call, in words; nothing while some are open."""
        with self._changed:
            if self._open:
                return []
            filled, self._filled = self._filled, Counter()
            gone, self._gone = self._gone, Counter()
        lines = []
        if count := filled.total():
            lines.append(f"FILLED {count} samples, lost on the way, had from their senders")
        if gone.total():
            lines.append(f"LOST {counted(gone)}: not to be had from their senders")
        return lines

    def close(self) -> None:
        """Ask no more."""
        with self._changed:
            self._over = True
            self._changed.notify_all()
        self.join()

    def run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._over or self._open)
                if self._over:
                    return
                gap = self._open[0]
            try:
                more = self._fill(gap)
            except Exception as error:  # the others may still be had
                print(f"GAP {gap.key}: {error!r}", file=sys.stderr, flush=True)
                with self._changed:
                    self._gone[gap.key] += gap.last + 1 - gap.first
                more = False
            with self._changed:
                self._open.popleft()
                if more:
                    self._open.append(gap)
                self._changed.notify_all()

    def _fill(self, gap: Gap) -> bool:
        """Fill the beginning of a gap; whether there is more to ask for."""
        question = numbers(gap.first, gap.last, self._most)
        answers = self._ask(recent_key(self._prefix + gap.key), question, ASK_S)
        if not answers:
            self._most = max(LEAST, self._most // 2)
            if time.monotonic() - self._answered < PATIENCE_S:
                with self._changed:
                    self._changed.wait_for(lambda: self._over, AGAIN_S)
                return True
        else:
            self._answered = time.monotonic()
        taken = [self._take(gap, data) for answer in answers for data in _samples(answer)]
        found = [number for number in taken if number is not None]
        last = max(found, default=gap.last)
        with self._changed:
            self._filled[gap.key] += len(found)
            self._gone[gap.key] += last + 1 - gap.first - len(found)
        gap.first = last + 1
        return gap.first <= gap.last


def _samples(answer: bytes) -> list[bytes]:
    try:
        _source, samples = msgpack.unpackb(answer)
        return list(samples)
    except (ValueError, TypeError):
        return []


def counted(counts: Counter[str] | dict[str, int]) -> str:
    """Counts in words: `12 of imu/data, 3 of pose`."""
    return ", ".join(f"{count} of {key}" for key, count in counts.items() if count)
