"""The last sweep of the guard: kills every process whose environment carries one of some marks.

The marks are its arguments. It is run by path, by `guard.sh` when the supervisor is gone, and
imports next to nothing.
"""

from __future__ import annotations

import os
import signal
import sys

MAX_SWEEPS = 20


def kill_marked(mark: str) -> list[int]:
    """Kill the processes with an environment entry that starts with `mark`; their ids.

    That finds helpers that left their group, and no stranger to whom an old number was given.
    """
    killed: list[int] = []
    for _ in range(MAX_SWEEPS):
        found = [pid for pid in _processes() if pid not in killed and _kill_if(pid, mark.encode())]
        if not found:
            break
        killed += found
    return killed


def _processes() -> list[int]:
    return [int(entry) for entry in os.listdir("/proc") if entry.isdigit()]  # noqa: PTH208


def _kill_if(pid: int, mark: bytes) -> bool:
    if pid == os.getpid():
        return False
    try:
        # The descriptor stands for this very process while we look, whatever its number becomes.
        handle = os.pidfd_open(pid)
    except OSError:
        return False
    try:
        with open(f"/proc/{pid}/environ", "rb") as file:  # noqa: PTH123 - pathlib is large
            entries = file.read().split(b"\0")
        if not any(entry.startswith(mark) for entry in entries):
            return False
        signal.pidfd_send_signal(handle, signal.SIGKILL)
    except OSError:
        return False
    finally:
        os.close(handle)
    return True


if __name__ == "__main__":
    for mark in sys.argv[1:]:
        kill_marked(mark)
