"""The guard: a process that outlives the supervisor by some milliseconds, and kills what is left.

It reads process groups from standard input (`+412` to watch one, `-412` to forget it) and at the
end of that file, which is the supervisor's death or its goodbye, kills them all, and then every
process whose environment carries one of the marks given as arguments.
It is told each group after the fact, so children carry a parent-death signal besides. It is run
by path and imports next to nothing: it costs each pipeline a process.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys

MAX_SWEEPS = 20


def main() -> None:
    """Serve one supervisor."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    groups: set[int] = set()
    for line in sys.stdin:
        group = int(line[1:])
        if line[0] == "+":
            groups.add(group)
        else:
            groups.discard(group)
    for group in groups:
        with contextlib.suppress(OSError):
            os.killpg(group, signal.SIGKILL)
    for mark in sys.argv[1:]:
        kill_marked(mark)


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
    main()
