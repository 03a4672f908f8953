"""Machines of a network that exists only in this computer: network namespaces joined by cables.

Needs root, util-linux and iproute2. A machine lives as long as the process that made it: nothing
is left behind, however that ends.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from typing import Self

PATIENCE_S = 2.0


def missing() -> str:
    """Why no machines can be made here; empty if they can."""
    for program in ("unshare", "nsenter", "ip"):
        if shutil.which(program) is None:
            return f"there is no program {program!r}"
    done = subprocess.run(["unshare", "-n", "true"], capture_output=True, text=True, check=False)
    return done.stderr.strip() if done.returncode else ""


class Machine:
    """A network of its own: `with Machine() as robot: subprocess.run(robot.command("ip", "a"))`."""

    def __init__(self) -> None:
        ours = _network(os.getpid())
        # It ends with the pipe, and so with us.
        self._holder = subprocess.Popen(["unshare", "-n", "--", "cat"], stdin=subprocess.PIPE)
        self.pid = self._holder.pid
        end = time.monotonic() + PATIENCE_S
        while _network(self.pid) == ours:
            if time.monotonic() > end or self._holder.poll() is not None:
                self.close()
                raise OSError("no network namespace could be made")
            time.sleep(0.005)
        self.run("ip", "link", "set", "lo", "up")

    def command(self, *words: str) -> list[str]:
        """A command line that runs a program on this machine."""
        return ["nsenter", "-t", str(self.pid), "-n", "--", *words]

    def run(self, *words: str) -> str:
        """Run a program to its end; what it printed. CalledProcessError if it failed."""
        done = subprocess.run(self.command(*words), capture_output=True, text=True, check=True)
        return done.stdout

    def close(self) -> None:
        """Unplug and forget it."""
        if self._holder.stdin is not None:
            self._holder.stdin.close()
        self._holder.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Wire:
    """A good cable between two machines, with the addresses `10.213.N.1` and `10.213.N.2`."""

    def __init__(self, one: Machine, other: Machine, number: int = 1) -> None:
        self._ends = [(one, f"w{number}a"), (other, f"w{number}b")]
        self.addresses = (f"10.213.{number}.1", f"10.213.{number}.2")
        words = ["ip", "link", "add", f"w{number}a", "type", "veth", "peer", "name", f"w{number}b"]
        one.run(*words, "netns", str(other.pid))
        for (machine, device), address in zip(self._ends, self.addresses, strict=True):
            machine.run("ip", "addr", "add", f"{address}/24", "dev", device)
        self.plug(True)

    def plug(self, plugged: bool) -> None:
        """Plug it in, or pull it out at both ends."""
        for machine, device in self._ends:
            machine.run("ip", "link", "set", device, "up" if plugged else "down")


def _network(pid: int) -> str:
    try:
        return os.readlink(f"/proc/{pid}/ns/net")  # noqa: PTH115 - not a path
    except OSError:
        return ""
