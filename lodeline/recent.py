"""What was sent of late: every output keeps it for a while, for those who could not hear it.

A node that was restarted asks for what came meanwhile, a recorder for what a cut link swallowed.
"""

from __future__ import annotations

from collections import deque

import msgpack

from lodeline_msgs import Message

KEPT_S = 20.0
"""How long a sample is kept, by the stamps of those that follow."""
KEPT_BYTES = 1 << 20
"""Of an output and no more, which shortens that: 8000 IMU samples are 8 s at 1 kHz."""
_KEPT_NS = int(KEPT_S * 1e9)
NEWEST = 512
"""Samples for who names no numbers, two and a half seconds at 200 Hz."""


def recent_key(key: str) -> str:
    """Where the newest samples of a key are to be had."""
    return f"{key}/@recent"


def numbers(first: int, last: int, most: int) -> bytes:
    """The question for samples by their numbers, both included, and for `most` bytes at once."""
    data: bytes = msgpack.packb([first, last, most])
    return data


class Recent:
    """Keeps the newest samples of an output; `keep` each, `answer` may run in any thread."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._kept: deque[tuple[int, int, bytes]] = deque()
        self._bytes = 0

    def keep(self, message: Message, data: bytes) -> None:
        """A sample that was just sent, and its bytes."""
        kept, stamp = self._kept, message.stamp
        kept.append((stamp, message.seq, data))
        self._bytes += len(data)
        while self._bytes > KEPT_BYTES or kept[0][0] < stamp - _KEPT_NS:
            self._bytes -= len(kept.popleft()[2])

    def answer(self, question: bytes = b"") -> bytes:
        """Who sends them, and samples from the oldest on, as one payload.

        By their `numbers` it is as many as were asked for, but one at least; without any it is
        the newest. A question that makes no sense has none for an answer.
        """
        kept = list(self._kept)  # in one step of the interpreter: `keep` cannot come between
        found = _chosen(kept, question) if question else [data for _, _, data in kept[-NEWEST:]]
        data: bytes = msgpack.packb([self._source, found])
        return data


def _chosen(kept: list[tuple[int, int, bytes]], question: bytes) -> list[bytes]:
    try:
        first, last, most = (int(number) for number in msgpack.unpackb(question))
    except (ValueError, TypeError):
        return []
    found: list[bytes] = []
    for _, seq, data in kept:
        if first <= seq <= last:
            most -= len(data)
            if most < 0 and found:
                break
            found.append(data)
    return found
