"""Keys whose names mean something to tools."""

from __future__ import annotations

TRUTH = "truth"
"""Last part of the key on which a simulator tells where the robot really is."""


def is_truth(key: str) -> bool:
    """Whether a key is the simulator's, by its last part."""
    return key.rpartition("/")[2] == TRUTH
