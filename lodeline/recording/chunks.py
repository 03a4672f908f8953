"""Messages out of the chunks of an MCAP file, in the order in which they were logged.

The library finds, unpacks and checks each chunk; the records in it are taken apart here, because
it makes objects of them all, a dozen calls for each, also of those that nobody wants.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary

_RECORD = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<BQHIQQ")  # these, channel, sequence, log and publish time; data follow
_parts = _MESSAGE.unpack_from

Found = tuple[int, int, int, int, int, int, bytes]
"""Log time [ns], place of the chunk, place in it, channel, sequence, publish time [ns], data."""


def messages(
    stream: BinaryIO, summary: Summary, channels: Collection[int], since: int
) -> Iterator[Found]:
    """Messages of some channels logged from `since` [ns] on, those of one time as in the file."""
    waiting: list[Found] = []
    for index in sorted(summary.chunk_indexes, key=lambda each: each.message_start_time):
        there = index.message_index_offsets
        if index.message_end_time < since or (
            there and not any(each in there for each in channels)
        ):
            continue
        ready = [each for each in waiting if each[0] < index.message_start_time]
        yield from ready
        waiting = waiting[len(ready) :]
        waiting += _of_chunk(stream, index, channels, since)
        waiting.sort()
    yield from waiting


def _of_chunk(
    stream: BinaryIO, index: ChunkIndex, channels: Collection[int], since: int
) -> list[Found]:
    offset = index.chunk_start_offset
    stream.seek(offset + _RECORD.size)
    unpacked, size = get_chunk_data_stream(Chunk.read(ReadDataStream(stream)), validate_crc=True)
    # with some zeros behind it even the shortest record can be looked at as if it were a message
    data, begin = unpacked.read(size) + bytes(_MESSAGE.size), 0
    is_message, before, header, parts = int(Opcode.MESSAGE), _RECORD.size, _MESSAGE.size, _parts
    found: list[Found] = []
    while begin < size:
        place = begin
        opcode, length, channel, sequence, log_time, publish_time = parts(data, place)
        begin += before + length
        if begin > size:
            raise ValueError(f"a record of {before + length} bytes at the end of a chunk")
        if opcode == is_message and channel in channels and log_time >= since:
            body = data[place + header : begin]
            found.append((log_time, offset, place, channel, sequence, publish_time, body))
    return found
