"""Recovery of recordings that were cut off or damaged: what is whole goes to a new file.

A killed recorder leaves a file without index and end, which no indexed reader opens. The records
before the cut are whole, and a damaged chunk costs its own messages alone.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from lodeline.recording import RecordingError, unreadable
from lodeline.recording.ends import MAGIC
from lodeline.recording.read import RECORD_LIMIT
from lodeline.recording.write import CHUNK_BYTES, whole_file

_NAMES = {Opcode.SCHEMA, Opcode.CHANNEL}
_KEPT = {*_NAMES, Opcode.MESSAGE, Opcode.CHUNK, Opcode.METADATA}
_HEAD = struct.Struct("<BQ")


@dataclass(slots=True)
class Recovered:
    """What came of it; `end` says where the file breaks off, empty if it does not."""

    messages: int = 0
    damaged: list[str] = field(default_factory=list)
    end: str = ""

    @property
    def complete(self) -> bool:
        """Whether nothing was missing."""
        return not self.damaged and not self.end


def recover(source: Path, target: Path, *, replace: bool = False) -> Recovered:
    """Write all that is whole in `source` to `target`; RecordingError if there is nothing."""
    try:
        stream = source.open("rb")
    except OSError as error:
        raise unreadable(source, error) from None
    found = Recovered()
    with stream, whole_file(target, replace=replace, source=source) as out:
        if stream.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{source} is no MCAP recording")
        copy = _Copy(out)
        # Names first: those in chunks, which have a checksum; then those that a closed file repeats
        # at its end, so that a damaged first chunk costs none.
        for kept, names_only in (({Opcode.CHUNK}, True), (_NAMES, True), (_KEPT, False)):
            stream.seek(len(MAGIC))
            found = Recovered()
            for opcode, raw in _whole_records(stream, found):
                if opcode in kept:
                    copy.take(raw, found, names_only=names_only)
        if found.messages == 0:
            raise RecordingError(f"{source}: not one whole message in it")
        copy.close()
    return found


def _whole_records(stream: BinaryIO, found: Recovered) -> Iterator[tuple[int, bytes]]:
    """(opcode, bytes) of each record up to the footer; says in `found.end` why it stops before."""
    while True:
        place = stream.tell()
        head = stream.read(_HEAD.size)
        if len(head) < _HEAD.size:
            found.end = f"ends at byte {place}, before its index was written"
            return
        opcode, length = _HEAD.unpack(head)
        body = stream.read(length) if opcode and length <= RECORD_LIMIT else b""
        if len(body) < length or not opcode:
            found.end = f"breaks off in the record at byte {place}"
            return
        yield opcode, head + body
        if opcode == Opcode.FOOTER:
            return


class _Copy:
    """A new file with channels and schemas numbered anew."""

    def __init__(self, out: BinaryIO) -> None:
        self._writer = Writer(out, chunk_size=CHUNK_BYTES, compression=CompressionType.LZ4)
        self._writer.start(library="lodeline")
        self._schemas = {0: 0}
        self._channels: dict[int, int] = {}

    def take(self, raw: bytes, found: Recovered, *, names_only: bool) -> None:
        """Copy one record; one that does not decode is noted and left out."""
        try:
            record = next(
                StreamReader(io.BytesIO(raw), skip_magic=True, emit_chunks=True).records, None
            )
            if isinstance(record, Chunk):
                for part in breakup_chunk(record, validate_crc=True):
                    if not (names_only and isinstance(part, Message)):
                        self._put(part, found)
            elif record is not None:
                self._put(record, found)
        except OSError:
            raise  # of the disk that is written to
        except Exception as error:  # the library raises a dozen kinds over damaged bytes
            found.damaged.append(f"{type(error).__name__}: {error}")

    def close(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _put(self, record: McapRecord, found: Recovered) -> None:
        if isinstance(record, Schema) and record.id not in self._schemas:
            self._schemas[record.id] = self._writer.register_schema(
                record.name, record.encoding, record.data
            )
        elif isinstance(record, Channel) and record.id not in self._channels:
            self._channels[record.id] = self._writer.register_channel(
                record.topic,
                record.message_encoding,
                self._schemas[record.schema_id],
                record.metadata,
            )
        elif isinstance(record, Metadata):
            self._writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Message):
            self._writer.add_message(
                self._channels[record.channel_id],
                record.log_time,
                record.data,
                record.publish_time,
                record.sequence,
            )
            found.messages += 1
