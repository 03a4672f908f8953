"""What a process costs, as the kernel counts it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(slots=True)
class Usage:
    """`cpu` is a part of one core between the last two samples, `rss` bytes of memory."""

    cpu: float = 0.0
    rss: int = 0
    _seconds: float = 0.0
    _at: float | None = None

    def sample(self, pid: int, now: float) -> None:
        """Read the counters of the process; leaves all as it is if there is none."""
        try:
            text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            return
        # The name, in brackets, may hold anything: count from behind it. proc(5), fields 14 on.
        fields = text.rpartition(")")[2].split()
        seconds = (int(fields[11]) + int(fields[12])) / _TICKS_PER_S
        if self._at is not None and now > self._at:
            self.cpu = (seconds - self._seconds) / (now - self._at)
        self.rss = int(fields[21]) * _PAGE
        self._seconds, self._at = seconds, now
