"""Writing recordings: MCAP with the messages exactly as they go over the wire.

Every channel carries the JSON schema of its message class. Chunks are small and the flush can be
timed, because what is not in the file when the power goes is gone.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from lodeline.recording import RecordingError
from lodeline_msgs import Message, json_schema, pack

CHUNK_BYTES = 8 << 10
FLUSH_S = 0.5
"""How often a live recorder should flush: what it loses when it is killed."""
METADATA = "lodeline"
"""Name of the metadata record that says where a recording is from."""
MESSAGE_ENCODING = "msgpack"
SCHEMA_ENCODING = "jsonschema"


class RecordingWriter:
    """Appends messages to a stream; nothing is buffered for longer than `flush_every` [s].

    `metadata` says where they are from (pipeline, digest, clock, source). With `flush_every` None
    only full chunks are written, so that the same messages always make the same bytes.
    """

    def __init__(
        self, stream: BinaryIO, metadata: Mapping[str, str], flush_every: float | None = None
    ) -> None:
        self._stream = stream
        self._flush_every = flush_every
        self._channels: dict[str, tuple[int, type[Message]]] = {}
        self._schemas: dict[type[Message], int] = {}
        self._writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.LZ4)
        self._writer.start(library="lodeline")
        self._writer.add_metadata(METADATA, dict(metadata))
        self._flushed = time.monotonic()
        if flush_every is not None:
            self.flush()

    def write(self, key: str, message: Message, log_time: int | None = None) -> None:
        """Append a message; `log_time` [ns] is when it was received, its stamp if None."""
        self.write_packed(
            key, type(message), pack(message), message.stamp, message.seq, log_time=log_time
        )

    def write_packed(
        self,
        key: str,
        cls: type[Message],
        data: bytes,
        stamp: int,
        seq: int,
        log_time: int | None = None,
    ) -> None:
        """Append the bytes of a message of class `cls`.

        Raises RecordingError where MCAP cannot hold it: a stamp before 1970, or a key that
        changes its class.
        """
        when = stamp if log_time is None else log_time
        if min(stamp, when) < 0:
            raise RecordingError(f"{key}: a recording holds no time before 1970 ({when} ns)")
        self._writer.add_message(
            self._channel(key, cls), when, data, publish_time=stamp, sequence=seq & 0xFFFFFFFF
        )
        if self._flush_every is not None:
            now = time.monotonic()
            if now - self._flushed >= self._flush_every:
                self.flush()

    def note(self, metadata: Mapping[str, str]) -> None:
        """Add to what the recording says of itself, such as how it ended."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._writer.add_metadata(METADATA, dict(metadata))

    def flush(self) -> None:
        """End the chunk and hand all to the operating system: a kill loses nothing before it."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._flushed = time.monotonic()

    def sync(self) -> None:
        """Flush, and wait until the disk has it: a power cut loses nothing before it."""
        self.flush()
        os.fdatasync(self._stream.fileno())

    def close(self) -> None:
        """Write index and summary; the stream stays open. OSError if the disk is full."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.flush()

    def _channel(self, key: str, cls: type[Message]) -> int:
        known = self._channels.get(key)
        if known is None:
            known = self._channels[key] = (self._register(key, cls), cls)
        if known[1] is not cls:
            raise RecordingError(f"{key} is {known[1].__name__}, now {cls.__name__} comes on it")
        return known[0]

    def _register(self, key: str, cls: type[Message]) -> int:
        if cls not in self._schemas:
            schema = json.dumps(json_schema(cls)).encode()
            self._schemas[cls] = self._writer.register_schema(cls.__name__, SCHEMA_ENCODING, schema)
        return self._writer.register_channel(key, MESSAGE_ENCODING, self._schemas[cls])


@contextmanager
def whole_file(
    path: Path, *, replace: bool = False, source: Path | None = None
) -> Iterator[BinaryIO]:
    """A new file that appears under its name when it is complete, or not at all.

    RecordingError if there is one already (unless `replace`), or it is the `source` that it is made
    of, or no folder to put it in, or a folder of that name.
    """
    if source is not None and path.exists() and source.exists() and path.samefile(source):
        raise RecordingError(f"{path} is the input: give another name")
    if path.exists() and not replace:
        raise RecordingError(f"{path} exists already: give another name, or --force to replace it")
    if path.is_dir():
        raise RecordingError(f"{path}: cannot be written: is a folder")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        stream = temporary.open("xb")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        with stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
