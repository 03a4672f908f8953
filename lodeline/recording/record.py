"""Recording a running pipeline: every sample that comes, as it came, until told to stop.

The rings of the bus hold what comes while the disk makes us wait, so nothing is lost on one
host; what is lost on the way all the same shows in the numbers of the samples, and is asked for.
What cannot be had is counted, told, and noted in the file. A kill costs the last half second, a
power cut the last second.
"""

from __future__ import annotations

import re
import threading
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, cast

from lodeline.clock import HostClock, epoch_offset
from lodeline.recording import RecordingError
from lodeline.recording.gaps import Ask, Gap, Gaps, counted
from lodeline.recording.room import Room
from lodeline.recording.sink import Sink
from lodeline.recording.summary import KeySummary
from lodeline.recording.write import RecordingWriter
from lodeline_msgs import MESSAGES, DecodeError, Message, class_of, unpack

QUEUE = 1 << 16
"""Samples that may wait while the disk does not take any: a minute of the default pipeline."""
SYNC_S = 1.0
NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,63}")


def default_name(pipeline: str, when: time.struct_time) -> str:
    """`NAME-YYYYmmdd-HHMMSS.mcap`; RecordingError for a name that might lead out of a folder."""
    if not NAME.fullmatch(pipeline):
        raise RecordingError(f"NAME {pipeline!r} not allowed in a file name: give one by -o")
    return f"{pipeline}-{time.strftime('%Y%m%d-%H%M%S', when)}.mcap"


class Recorder:
    """Writes samples of the keys `types` (with their classes, without the pipeline's name).

    `take` is called by the threads of the bus; `tend` by the thread that owns the recorder, twice
    a second, and `close` at the end. `stopped` is set when the disk takes no more, or shall not.
    `ask` is how to ask senders for what got lost.
    """

    def __init__(
        self,
        path: Path,
        pipeline: str,
        types: Mapping[str, str],
        metadata: Mapping[str, str],
        *,
        replace: bool = False,
        ask: Ask | None = None,
    ) -> None:
        self.flows = {key: KeySummary(cls) for key, cls in types.items()}
        self.refused: dict[str, str] = {}
        self.stopped = threading.Event()
        self.room = Room(path.absolute().parent)
        self.sink = Sink(path, replace=replace)
        self._prefix = f"{pipeline}/"
        self._clock = HostClock(epoch_offset())
        self._writer = RecordingWriter(cast(BinaryIO, self.sink), metadata)
        self._lock = threading.Lock()
        self.filled: Counter[str] = Counter()
        self._newest: dict[str, tuple[int, int]] = {}
        self.gaps = None if ask is None else Gaps(ask, self._fill, self._prefix)
        if self.gaps is not None:
            self.gaps.start()
        self._syncer = threading.Thread(target=self._sync, name="sync", daemon=True)
        self._syncer.start()

    def take(self, key: str, data: bytes, encoding: str) -> None:
        """Append a sample; what is no sample of its key's class is refused and noted."""
        now = self._clock.now()
        short = key.removeprefix(self._prefix)
        flow = self.flows.get(short)
        if flow is None:
            return
        try:
            message = self._checked(data, encoding, flow.type_name)
            with self._lock:
                if not self.stopped.is_set():
                    self._writer.write_packed(
                        short, type(message), data, message.stamp, message.seq, log_time=now
                    )
                    first, here = flow.next_seq, (message.stamp, now)
                    before, self._newest[short] = self._newest.get(short, here), here
                    if flow.count(message.stamp, message.seq) and self.gaps is not None:
                        self.gaps.find(Gap(short, first, message.seq - 1, before, here))
        except (DecodeError, RecordingError) as error:
            self.refused[short] = str(error)
        self._look()

    def _fill(self, gap: Gap, data: bytes) -> int | None:
        """Append a sample that got lost where it belongs; its number, None if it does not."""
        flow = self.flows[gap.key]
        try:
            message = unpack(data, MESSAGES[flow.type_name])
        except DecodeError:
            return None
        when = gap.place(message.stamp, message.seq)
        with self._lock:
            if when is None or self.stopped.is_set():
                return None
            self._writer.write_packed(
                gap.key, type(message), data, message.stamp, message.seq, log_time=when
            )
            flow.samples, flow.lost = flow.samples + 1, flow.lost - 1
            self.filled[gap.key] += 1
        return message.seq

    def _checked(self, data: bytes, encoding: str, wanted: str) -> Message:
        cls = class_of(encoding)
        if cls.__name__ != wanted:
            raise DecodeError("another class", f"{cls.__name__} where {wanted} is expected")
        return unpack(data, cls)

    def tend(self) -> None:
        """Hand all to the operating system, which keeps it if we are killed."""
        with self._lock:
            self._writer.flush()
            self.sink.hold()
        self.room.look(self.sink.written)
        self._look()

    def _look(self) -> None:
        if self.sink.full or self.sink.error or self.room.gone:
            self.stopped.set()

    def _sync(self) -> None:
        due = time.monotonic() + SYNC_S
        while not self.stopped.wait(max(0.0, due - time.monotonic())):
            due = time.monotonic() + SYNC_S  # a slow disk does not put off the next time
            with self._lock:
                self._writer.flush()
            self.sink.sync()

    def close(self, end: str) -> None:
        """Write why it ended and what was lost, the index and the footer."""
        self.stopped.set()
        self._syncer.join()
        if self.gaps is not None:
            self.gaps.close()
        filled = {"filled": counted(self.filled)} if self.filled else {}
        with self._lock:
            self._writer.note({"end": end, "lost": self.lost_text() or "nothing", **filled})
            self._writer.close()
            self.sink.close()

    @property
    def samples(self) -> int:
        """Samples that were taken."""
        return sum(flow.samples for flow in self.flows.values())

    @property
    def lost(self) -> dict[str, int]:
        """Samples whose numbers are missing, by key."""
        return {key: flow.lost for key, flow in self.flows.items() if flow.lost}

    def lost_text(self) -> str:
        """The same in words: `12 of imu/data, 3 of pose`."""
        return counted(self.lost)
