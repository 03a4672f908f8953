"""What a node process must know of a pipeline; the rest of its model stays with the supervisor."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Edge:
    """An input port's line to a key: how many samples may wait, and how old they may be [s]."""

    key: str
    queue: int
    max_age: float | None
