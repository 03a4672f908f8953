"""What was sent of late: every output keeps it for a while, for those who could not hear it.

A node that was restarted asks for what came meanwhile, a recorder for what a cut link swallowed.
Samples of one key resemble each other: what is older than a second or so is kept compressed, in
a quarter of the memory.
"""

from __future__ import annotations

import threading
import zlib
from collections import deque
from itertools import chain
from typing import NamedTuple

import msgpack

from lodeline_msgs import Message

KEPT_S = 20.0
"""How long a sample is kept, by the stamps of those that follow."""
KEPT_BYTES = 1 << 20
"""Of an output as it was sent, which shortens that: 8000 IMU samples are 8 s at 1 kHz."""
_KEPT_NS = int(KEPT_S * 1e9)
_FAST = 1
MANY = 64
"""Samples that make a block: more compress no better, and hold a processor up for longer."""
NEWEST = 512
"""Samples for who names no numbers, two and a half seconds at 200 Hz."""


def recent_key(key: str) -> str:
    """Where the newest samples of a key are to be had."""
    return f"{key}/@recent"


def numbers(first: int, last: int, most: int) -> bytes:
    """The question for samples by their numbers, both included, and for `most` bytes at once."""
    data: bytes = msgpack.packb([first, last, most])
    return data


class _Block(NamedTuple):
    """Samples in a row: numbers of the first and the last, stamp of the last, bytes as sent."""

    first: int
    last: int
    stamp: int
    size: int
    packed: bytes

    def samples(self) -> list[tuple[int, bytes]]:
        """Number and bytes of each."""
        return list(zip(*msgpack.unpackb(zlib.decompress(self.packed)), strict=True))


class Recent:
    """Keeps the newest samples of an output: `keep` each in the thread that sends it, `pack` what
    came since, in one that has time, once a second and as soon as there are `many`; `answer` may
    run in any thread.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._fresh: deque[tuple[int, int, bytes]] = deque()
        self._blocks: deque[_Block] = deque()
        self._bytes = 0
        self._lock = threading.Lock()  # no sample is on its way into a block while one looks

    def keep(self, message: Message, data: bytes) -> None:
        """A sample that was just sent, and its bytes."""
        self._fresh.append((message.seq, message.stamp, data))

    @property
    def many(self) -> bool:
        """Whether enough for a block came since the last `pack`."""
        return len(self._fresh) >= MANY

    def pack(self) -> None:
        """Compress what came since the last call, and forget what is too old."""
        with self._lock:
            fresh = [self._fresh.popleft() for _ in range(len(self._fresh))]
            if not fresh:
                return
            seqs, stamps, samples = zip(*fresh, strict=True)
            size = sum(map(len, samples))
            packed = _compressed(msgpack.packb([seqs, samples]))
            blocks, stamp = self._blocks, stamps[-1]
            blocks.append(_Block(seqs[0], seqs[-1], stamp, size, packed))
            self._bytes += size
            while len(blocks) > 1 and (
                self._bytes > KEPT_BYTES or blocks[0].stamp < stamp - _KEPT_NS
            ):
                self._bytes -= blocks.popleft().size

    def answer(self, question: bytes = b"") -> bytes:
        """Who sends them, and samples from the oldest on, as one payload.

        By their `numbers` it is as many as were asked for, but one at least; without any it is
        the newest. A question that makes no sense has none for an answer.
        """
        with self._lock:
            blocks = list(self._blocks)
            fresh = [(seq, data) for seq, _, data in list(self._fresh)]
        found = _chosen(blocks, fresh, question) if question else _newest(blocks, fresh)
        data: bytes = msgpack.packb([self._source, found])
        return data


def _compressed(data: bytes) -> bytes:
    """In half of zlib's usual memory: all of that would be mapped and touched for each block."""
    made = zlib.compressobj(_FAST, wbits=14, memLevel=7)
    return made.compress(data) + made.flush()


def _newest(blocks: list[_Block], fresh: list[tuple[int, bytes]]) -> list[bytes]:
    found = fresh
    while blocks and len(found) < NEWEST:
        found = blocks.pop().samples() + found
    return [data for _, data in found[-NEWEST:]]


def _chosen(blocks: list[_Block], fresh: list[tuple[int, bytes]], question: bytes) -> list[bytes]:
    try:
        first, last, most = (int(number) for number in msgpack.unpackb(question))
    except (ValueError, TypeError):
        return []
    found: list[bytes] = []
    parts = (block.samples() for block in blocks if block.first <= last and first <= block.last)
    for part in chain(parts, [fresh]):
        for seq, data in part:
            if first <= seq <= last:
                most -= len(data)
                if most < 0 and found:
                    return found
                found.append(data)
    return found
