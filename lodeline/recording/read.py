"""Reading recordings: channels, metadata, and messages in the order in which they were logged."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mcap.reader import SeekingReader
from mcap.records import Channel, Schema
from mcap.summary import Summary

from lodeline.recording import RecordingError, unreadable
from lodeline.recording.chunks import Found, messages
from lodeline.recording.ends import check_ends, way_out
from lodeline.recording.write import MESSAGE_ENCODING, METADATA
from lodeline_msgs import MESSAGES, DecodeError, Message, class_described, unpacker_of

RECORD_LIMIT = 64 << 20
"""Longest record [bytes] that is believed; a longer one is a damaged length."""
KEY = re.compile(r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*")


class Sample(NamedTuple):
    """One message of a recording; `log_time` [ns] is when it was received."""

    key: str
    message: Message
    log_time: int


class Packed(NamedTuple):
    """One message as bytes; `stamp` [ns] is when it was published, `log_time` when received."""

    key: str
    data: bytes
    stamp: int
    seq: int
    log_time: int


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A key of a recording; `type` is None if nothing tells what its class `type_name` holds."""

    key: str
    type_name: str
    type: type[Message] | None
    count: int


class Recording:
    """An MCAP file, open for reading; a context manager.

    Raises RecordingError, from here or while iterating, for what is missing, no MCAP, cut off or
    damaged. A class that is not known here, such as one in a node's own file, is read by the schema
    in the file; channels that have none of ours are listed but never read. `span` is the first and
    the last log time [ns].
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        check_ends(path)
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise unreadable(path, error) from None
        self.metadata: dict[str, str] = {}
        self.channels: dict[str, ChannelInfo] = {}
        self.span = (0, 0)
        try:
            with self._damage():
                self._reader = SeekingReader(
                    self._stream, validate_crcs=True, record_size_limit=RECORD_LIMIT
                )
                self._read_summary()
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def packed(self, keys: Collection[str] | None = None, since: int = 0) -> Iterator[Packed]:
        """Messages as bytes by log time, those of one time in the order of the file.

        Those logged before `since` [ns] are left out.
        """
        topics = self._topics(keys)
        with self._damage():
            for log_time, _, _, channel, sequence, publish_time, data in self._found(topics, since):
                yield Packed(topics[channel], data, publish_time, sequence, log_time)

    def samples(self, keys: Collection[str] | None = None) -> Iterator[Sample]:
        """Messages as objects, in the same order; RecordingError for one that is malformed."""
        topics = self._topics(keys)
        ways: dict[int, tuple[str, Callable[[bytes], Message]]] = {}
        for channel, key in topics.items():
            known = self.channels[key].type
            assert known is not None  # else it would be none of the topics
            ways[channel] = key, unpacker_of(known)
        with self._damage():
            for log_time, _, _, channel, _, _, data in self._found(topics, 0):
                key, unpacker = ways[channel]
                try:
                    message = unpacker(data)
                except DecodeError as error:
                    raise RecordingError(f"{self.path}: {key} at {log_time} ns: {error}") from None
                yield Sample(key, message, log_time)

    def _topics(self, keys: Collection[str] | None) -> dict[int, str]:
        """Keys that are asked for (None: all) and known, by the number of their channel."""
        return {
            each.id: each.topic
            for each in self._summary.channels.values()
            if self.channels[each.topic].type is not None and (keys is None or each.topic in keys)
        }

    def _found(self, topics: Mapping[int, str], since: int) -> Iterator[Found]:
        if not topics:
            return iter(())
        if self._summary.chunk_indexes:
            return messages(self._stream, self._summary, topics, since)
        return (  # a file as others may write it
            (each.log_time, 0, 0, channel.id, each.sequence, each.publish_time, each.data)
            for _, channel, each in self._reader.iter_messages(
                topics=set(topics.values()), starting_at=since
            )
        )

    def _read_summary(self) -> None:
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise RecordingError(f"{self.path} has no index; {way_out(self.path)}")
        self._summary = summary
        times = summary.statistics
        self.span = (times.message_start_time, times.message_end_time)
        for record in self._reader.iter_metadata():
            if record.name == METADATA:
                self.metadata |= record.metadata
        for channel in summary.channels.values():
            self._add(channel, summary)

    def _add(self, channel: Channel, summary: Summary) -> None:
        schema = summary.schemas.get(channel.schema_id)
        statistics = summary.statistics
        count = statistics.channel_message_counts.get(channel.id, 0) if statistics else 0
        info = ChannelInfo(
            channel.topic, schema.name if schema else "", _class_of(channel, schema), count
        )
        before = self.channels.get(channel.topic)
        if before is not None:
            if before.type_name != info.type_name:
                raise RecordingError(
                    f"{self.path}: {channel.topic} is both {before.type_name} and {info.type_name}"
                )
            info = ChannelInfo(info.key, info.type_name, info.type, before.count + count)
        self.channels[channel.topic] = info

    @contextmanager
    def _damage(self) -> Iterator[None]:
        """Whatever the MCAP library raises over a damaged file, as one RecordingError."""
        try:
            yield
        except RecordingError:
            raise
        except Exception as error:  # MemoryError too: a damaged length asks for exabytes
            what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
            raise RecordingError(
                f"{self.path} is damaged ({what}); {way_out(self.path)}"
            ) from error


def _class_of(channel: Channel, schema: Schema | None) -> type[Message] | None:
    if schema is None or channel.message_encoding != MESSAGE_ENCODING:
        return None
    if not KEY.fullmatch(channel.topic):
        return None
    if schema.name in MESSAGES:
        return MESSAGES[schema.name]
    try:
        return class_described(json.loads(schema.data) | {"title": schema.name})
    except (ValueError, TypeError, RecursionError):
        return None
