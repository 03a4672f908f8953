"""A robot and a laptop on a bad cable, with a pipeline running on both, and ears on either side."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Self

from lodeline.bench.cable import Cable
from lodeline.bench.machines import Machine
from lodeline.clock import HostClock, epoch_offset
from lodeline.loading import shipped
from lodeline.run_folder import VARIABLE, running
from lodeline.sessions import Client
from lodeline_msgs import MESSAGES, unpack

PATIENCE_S = 30.0
RECORDS = 20_000  # bytes of a recording that is under way
HOSTS = """
name: {name}
hosts:
  robot: {{listen: {address}}}
  laptop: {{connect: {address}}}
{more}
"""
NODES = """
nodes:
  simulator: {{run: {nodes}/simulator.py, outputs: {{truth: truth}}, params: {{rate: 50}}}}
  imu: {{run: {nodes}/imu.py, outputs: {{data_raw: imu/data_raw, mag_raw: imu/mag_raw}},
        params: {{bus: sim, rate: 200}}}}
  encoders: {{run: {nodes}/encoders.py, outputs: {{wheels: wheels}},
             params: {{bus: sim, rate: 100}}}}
  odometry: {{run: {nodes}/odometry.py, inputs: {{wheels: wheels}}, outputs: {{odom: odom}},
             params: {{wheel_radius: 0.0215, track: 0.112, ticks_per_turn: 16384}}}}
"""


@dataclass(frozen=True, slots=True)
class Heard:
    """What came of a key in a stretch of time."""

    received: int
    lost: int
    p50: Annotated[float, "s"]
    p99: Annotated[float, "s"]
    oldest: Annotated[float, "s"]
    silence: Annotated[float, "s"]


class Ear:
    """Listens to a key at a host's hub, as a tool would; `work` [s] is spent on each sample."""

    def __init__(
        self, client: Client, key: str, kind: str, queue: int = 256, work: float = 0.0
    ) -> None:
        self._kind = MESSAGES[kind]
        self._clock = HostClock(epoch_offset())
        self._work = work
        self.samples: list[tuple[float, int, float]] = []
        client.subscribe(key, queue, self._take)

    def _take(self, _key: str, data: bytes, _encoding: str) -> None:
        message = unpack(data, self._kind)
        age = (self._clock.now() - message.stamp) * 1e-9
        self.samples.append((time.monotonic(), message.seq, age))
        if self._work:
            time.sleep(self._work)

    def after(self, instant: float) -> float | None:
        """How long after an instant [s, monotonic] the first sample came that is not old.

        What was under way is no sign of a link that works.
        """
        for at, _, age in list(self.samples):
            if at > instant and at - age > instant:
                return at - instant
        return None

    def between(self, begin: float, end: float) -> Heard:
        """What was heard between two instants [s, monotonic]."""
        samples = [sample for sample in list(self.samples) if sample[0] < end]
        heard = [sample for sample in samples if sample[0] >= begin]
        ages = sorted(age for _, _, age in heard) or [float("nan")]
        instants = [begin, *(at for at, _, _ in heard), end]
        # Counted from the last one before, so that a silence at the beginning counts.
        known = samples[-len(heard) - 1 :]
        lost = known[-1][1] - known[0][1] + 1 - len(known) if heard else 0
        return Heard(
            received=len(heard),
            lost=lost,
            p50=ages[len(ages) // 2],
            p99=ages[int(0.99 * len(ages))],
            oldest=ages[-1],
            silence=max(b - a for a, b in pairwise(instants)),
        )


class Side:
    """One machine's `lodeline up --host NAME`."""

    def __init__(self, machine: Machine, file: Path, host: str, folder: Path) -> None:
        self.machine = machine
        self.run = folder / host
        self.run.mkdir(exist_ok=True)
        self._log = (folder / f"{host}.log").open("a+")
        self._command = machine.command(
            *(sys.executable, "-P", "-m", "lodeline", "up", str(file), "--host", host)
        )
        self.start()

    def _environment(self) -> dict[str, str]:
        return os.environ | {VARIABLE: str(self.run), "NO_COLOR": "1"}

    def start(self) -> None:
        """Bring it up, and wait until it is. TimeoutError with its last words if it is not."""
        begin = self._log.seek(0, os.SEEK_END)
        self.process = subprocess.Popen(self._command, env=self._environment(), stderr=self._log)
        end = time.monotonic() + PATIENCE_S
        while "up in " not in (words := self.log(begin)):
            if time.monotonic() > end or self.process.poll() is not None:
                raise TimeoutError(f"it did not come up:\n{words}")
            time.sleep(0.05)

    def log(self, begin: int = 0) -> str:
        """What it said since a place in its log."""
        self._log.seek(begin)
        return self._log.read()

    def client(self) -> Client:
        """A tool's line to its hub."""
        (found,) = running(base=self.run)
        return Client(found.folder)

    @contextmanager
    def recorded(self, file: Path) -> Iterator[None]:
        """Record all that comes, as its user would; the file is whole afterwards."""
        words = (sys.executable, "-P", "-m", "lodeline", "bag", "record", "-o", str(file))
        process = subprocess.Popen(
            words, env=self._environment(), stdout=subprocess.PIPE, stderr=self._log
        )
        try:
            end = time.monotonic() + PATIENCE_S
            while not (file.exists() and file.stat().st_size > RECORDS):
                if time.monotonic() > end or process.poll() is not None:
                    raise TimeoutError(f"nothing is recorded:\n{self.log()}")
                time.sleep(0.05)
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE_S)

    def sockets(self) -> int:
        """TCP connections that its machine believes in."""
        return len(self.machine.run("ss", "-H", "-t", "-n", "state", "established").splitlines())

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(signal.SIGINT)
            self.process.wait(PATIENCE_S)


def make_keys(folder: Path, *addresses: str) -> None:
    """An authority, and keys for the robot at some addresses and for its laptop."""
    from lodeline.hosts import certificates

    certificates.init(folder)
    certificates.add(folder, "robot", addresses)
    certificates.add(folder, "laptop")


class Pair:
    """`with Pair() as pair:` robot and laptop up and linked; `pair.cable.fault` spoils the link,
    which is mutual TLS if it is `secured`.
    """

    def __init__(self, secured: bool = False) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True)
        self._sides: list[Side] = []
        self.folder = folder = Path(self._temporary.name)
        robot, laptop = self._machines = (Machine(), Machine())
        self.cable = Cable(robot, laptop)
        file, address = folder / "pipeline.yaml", self.cable.addresses[0]
        if secured:
            make_keys(folder / "keys", address)
        more = "tls: keys" if secured else ""
        file.write_text(
            (HOSTS + NODES).format(name="rover", address=address, nodes=shipped("nodes"), more=more)
        )
        try:
            self.robot, self.laptop = (
                self._side(machine, file, host)
                for machine, host in zip(self._machines, ("robot", "laptop"), strict=True)
            )
        except BaseException:
            self.close()
            raise

    def _side(self, machine: Machine, file: Path, host: str) -> Side:
        side = Side(machine, file, host, Path(self._temporary.name))
        self._sides.append(side)
        return side

    def close(self) -> None:
        self.cable.fault = type(self.cable.fault)()
        for side in reversed(self._sides):
            side.stop()
        self.cable.close()
        for machine in self._machines:
            machine.close()
        self._temporary.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
