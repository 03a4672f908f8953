"""What a process that lives long does about the memory that its start took."""

from __future__ import annotations

import ctypes
import gc
from typing import Any

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
MAPPED_FROM = 65_536
"""Bytes from which a piece of memory is mapped for itself: a buffer of zenoh's for a link has so
many, of which small samples touch a page or two, and it goes back whole."""
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


def be_sparing() -> None:
    """Do for this process what a node's environment does from its start (see `supervisor`).

    Threads that are started later take their memory from one heap, and buffers are mapped.
    """
    _libc("mallopt", _M_ARENA_MAX, 1)
    _libc("mallopt", _M_MMAP_THRESHOLD, MAPPED_FROM)


def _libc(name: str, *arguments: Any) -> None:
    call = getattr(ctypes.CDLL(None), name, None)
    if call is not None:  # glibc, and no other libc
        call(*arguments)
