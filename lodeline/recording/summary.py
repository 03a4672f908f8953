"""What is in a recording, at a glance."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import shorten
from typing import Any

from lodeline.recording.read import Recording
from lodeline_msgs import stamp_text

LONGEST = 80
"""Letters of a word about the recording that people are shown."""


@dataclass(slots=True)
class KeySummary:
    """One key: class, messages, how many numbers are missing between them, first and last stamp."""

    type_name: str
    samples: int = 0
    lost: int = 0
    first: int = 0
    last: int = 0
    next_seq: int = -1

    def count(self, stamp: int, seq: int) -> int:
        """Note a message; how many numbers are missing before it.

        Numbers that go back are those of a sender that started anew.
        """
        missing = max(0, seq - self.next_seq) if self.next_seq >= 0 else 0
        self.first = min(self.first, stamp) if self.samples else stamp
        self.last = max(self.last, stamp)
        self.lost += missing
        self.samples, self.next_seq = self.samples + 1, seq + 1
        return missing

    @property
    def rate(self) -> float:
        """Mean rate [Hz], 0 for less than two messages."""
        span = self.last - self.first
        return (self.samples - 1) / (span * 1e-9) if span > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Summary:
    """A recording: where it is from, and its keys. Keys of unknown classes have counts alone."""

    path: str
    metadata: dict[str, str]
    keys: dict[str, KeySummary]

    @property
    def start(self) -> int:
        """First stamp [ns]."""
        return min((key.first for key in self.keys.values() if key.last), default=0)

    @property
    def duration(self) -> float:
        """From the first stamp to the last [s]."""
        return (max((key.last for key in self.keys.values()), default=0) - self.start) * 1e-9

    def as_json(self) -> dict[str, Any]:
        """Values for `--json`: stamps in ns, rates in Hz, duration in s."""
        return {
            "file": self.path,
            "metadata": self.metadata,
            "start": self.start,
            "duration": self.duration,
            "keys": {
                name: {
                    "type": key.type_name,
                    "samples": key.samples,
                    "rate": key.rate,
                    "lost": key.lost,
                }
                for name, key in self.keys.items()
            },
        }

    def as_text(self) -> str:
        """A table for people."""
        lines = [
            f"{name}: {shorten(value, LONGEST, placeholder=' ...')}"
            for name, value in self.metadata.items()
            if value
        ]
        lines.append(f"start: {stamp_text(self.start)} s, duration: {self.duration:.3f} s")
        wide = max(map(len, ["key", *self.keys]))
        kind = max(map(len, ["class", *(key.type_name for key in self.keys.values())]))
        lines.append(f"{'key':{wide}}  {'class':{kind}}  {'samples':>8}  {'Hz':>8}  {'lost':>6}")
        lines += [
            f"{name:{wide}}  {key.type_name:{kind}}  {key.samples:8}  {key.rate:8.2f}  {key.lost:6}"
            for name, key in self.keys.items()
        ]
        return "\n".join(lines)


def summarize(recording: Recording) -> Summary:
    """Read a recording through and count; messages are not decoded."""
    keys = {name: KeySummary(info.type_name) for name, info in recording.channels.items()}
    for packed in recording.packed():
        keys[packed.key].count(packed.stamp, packed.seq)
    for name, info in recording.channels.items():
        if info.type is None:
            keys[name].samples = info.count
    return Summary(str(recording.path), recording.metadata, keys)
