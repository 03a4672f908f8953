"""What a process that lives long does about the memory that its start took."""

from __future__ import annotations

import ctypes
import gc
from typing import Any

_M_ARENA_MAX = -8
_YOUNG = 10_000
"""New objects that have the collector look for rings among them. What a node keeps for a while
comes and goes by some thousand; with Python's 700 the collector went through it time and again, and
held a sample up for some milliseconds each time."""


def settle() -> None:
    """What is there now stays, and is not looked through again; what is free goes back."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(_YOUNG)
    _libc("malloc_trim", 0)


def share_one_heap() -> None:
    """Let threads that are started later take their memory from one heap, not from one for each.

    It is what MALLOC_ARENA_MAX=1 in the environment does for a process from its start.
    """
    _libc("mallopt", _M_ARENA_MAX, 1)


def _libc(name: str, *arguments: Any) -> None:
    call = getattr(ctypes.CDLL(None), name, None)
    if call is not None:  # glibc, and no other libc
        call(*arguments)
