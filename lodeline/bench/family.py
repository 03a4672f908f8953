"""Processes below a process, and what the kernel counts of them: time, memory, threads."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated


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
    """Time that all living threads of a process have been on a processor."""
    total = 0
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(OSError):
                total += int((task / "schedstat").read_text().split()[0])
    return total * 1e-9


def memory(pid: int) -> Memory:
    """What a process holds; OSError if it is gone."""
    sizes = {
        line.split(":")[0]: int(line.split()[1]) * 1024
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]
    }
    return Memory(sizes["Rss"], sizes["Pss"], len(os.listdir(f"/proc/{pid}/task")))  # noqa: PTH208
