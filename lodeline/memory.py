"""What a process that lives long does about the memory that its start took."""

from __future__ import annotations

import ctypes
import gc
import os
from typing import Any

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
MAPPED_FROM = 65_536
"""Bytes from which a piece of memory is mapped for itself: a buffer of zenoh's for a link has so
many, of which small samples touch a page or two, and it goes back whole."""
_YOUNG = 10_000
"""New objects that have the collector look for rings among them. What a node keeps for a while
comes and goes by some thousand; with Python's 700 the collector went through it time and again, and
held a sample up for some milliseconds each time."""
_MADV_DONTNEED = 4
_WORTH_IT = 1 << 18
"""Bytes of a file that must be mapped for it to be looked at."""
WORKING_S = 10.0
"""After so long at work, what only the start needed has been idle for long enough."""
_SMAPS = "/proc/self/smaps"
_PAGE = os.sysconf("SC_PAGE_SIZE")


def resident(pid: int) -> int:
    """Bytes of memory of a process, 0 if there is none."""
    try:
        with open(f"/proc/{pid}/statm") as file:  # noqa: PTH123 - pathlib is large
            return int(file.read().split()[1]) * _PAGE
    except OSError:
        return 0


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


class IdleCode:
    """Lets go of the pages of programs and libraries that only the start of this process ran.

    To import, to open a session and to lay wires takes 8 MB of code that hardly anything touches
    later. What is still in use comes back by itself out of the kernel's own memory, in 0.2 ms.
    """

    def __init__(self, now: float) -> None:
        self._due: float | None = now + WORKING_S

    def look(self, now: float) -> None:
        """Let go once, `WORKING_S` after the work began; `now` is monotonic [s]."""
        if self._due is None or now < self._due:
            return
        self._due = None
        # With the interpreter held nobody loads a library meanwhile, so that what was read holds.
        libc = ctypes.PyDLL(None)
        for start, end in _unchanged_code():
            libc.madvise(ctypes.c_void_p(start), ctypes.c_size_t(end - start), _MADV_DONTNEED)


def _unchanged_code() -> list[tuple[int, int]]:
    """Begin and end of what is mapped from files, to be read or run, and was never written to."""
    found: list[tuple[int, int]] = []
    if not os.path.exists(_SMAPS):  # noqa: PTH110 - pathlib is large
        return found
    with open(_SMAPS) as file:  # noqa: PTH123
        start = end = 0
        for line in file:
            words = line.split()
            if not words[0].endswith(":"):  # a new mapping: addresses, rights, ..., file
                start, end = (int(word, 16) for word in words[0].split("-"))
                code = words[1] in ("r-xp", "r--p") and words[-1].startswith("/")
                wanted = code and end - start >= _WORTH_IT
            elif wanted and words[:2] == ["Anonymous:", "0"]:
                found.append((start, end))
    return found


def _libc(name: str, *arguments: Any) -> None:
    call = getattr(ctypes.CDLL(None), name, None)
    if call is not None:  # glibc, and no other libc
        call(*arguments)
