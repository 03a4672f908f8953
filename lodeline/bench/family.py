"""Processes below a process, and what the kernel counts of them: time, memory, threads."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

_SCHEDULED = 2
"""In the number of a process's clock, behind its own: to the nanosecond. clock_getcpuclockid(3)"""


@dataclass(frozen=True, slots=True)
class Memory:
    """Of one process: `pss` counts pages that several share in parts, so that sums are true."""

    rss: Annotated[int, "B"]
    pss: Annotated[int, "B"]
    threads: int


def family(roots: Iterable[int]) -> list[int]:
    """Some processes and all their descendants that live."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                # The name, in brackets, may hold anything: count from behind it. proc(5)
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                if fields[0] != "Z":
                    parents[int(entry.name)] = int(fields[1])
    found = {root for root in roots if root in parents}
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return sorted(found)


def cpu_seconds(pid: int) -> float:
    """Time that a process was on a processor, in threads that ended too; 0.0 if it is gone."""
    try:
        return time.clock_gettime(~pid << 3 | _SCHEDULED)
    except OSError:
        return 0.0


def memory(pid: int) -> Memory:
    """What a process holds; OSError if it is gone."""
    sizes = {
        line.split(":")[0]: int(line.split()[1]) * 1024
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]
    }
    return Memory(sizes["Rss"], sizes["Pss"], len(os.listdir(f"/proc/{pid}/task")))  # noqa: PTH208
