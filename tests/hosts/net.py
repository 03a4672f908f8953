"""Two machines in network namespaces, a robot and a laptop, and one small pipeline for both."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from lodeline.bench.machines import Machine, Wire, missing
from tests.support.live import Up

NODES = Path(__file__).parents[1] / "data" / "nodes"
PIPELINE = """
name: {name}
hosts: {hosts}
{more}
external: {{cmd_vel: Twist}}
nodes:
  source: {{run: nodes/source.py, inputs: {{cmd_vel: cmd_vel}}, outputs: {{wheels: wheels}},
           rate: {{wheels: 100}}}}
  smoother: {{run: nodes/smoother.py, inputs: {{wheels: wheels}}, outputs: {{speed: speed}}}}
  watcher: {{run: nodes/watcher.py, host: {watcher},
            inputs: {{speed: {{key: speed, max_age: 5.0}}}},
            params: {{limit: 3}}}}
"""


def hosts_at(address: str) -> str:
    """The two hosts of a pipeline file, the robot listening on an address."""
    return f"{{robot: {{listen: {address}}}, laptop: {{connect: {address}}}}}"


def write_file(place: Path, hosts: str, *, name: str, watcher: str, more: str = "") -> Path:
    """A pipeline file in a folder of its own, with its nodes."""
    shutil.copytree(NODES, place / "nodes", dirs_exist_ok=True)
    file = place / "pipeline.yaml"
    file.write_text(PIPELINE.format(name=name, hosts=hosts, watcher=watcher, more=more))
    return file


class Host(Up):
    """`lodeline up --host NAME` on a machine, with a run folder of its own."""

    def __init__(
        self, machine: Machine, file: Path, name: str, *more: str, base: Path | None = None
    ) -> None:
        super().__init__(file, "--host", name, *more, base=base)
        self._command = machine.command(*self._command)
        self.machine = machine
        self.name = name

    def ask(self) -> list[dict[str, Any]]:
        """What `lodeline ps --json` says here."""
        result = self.call("ps", "--json")
        assert result.returncode == 0, result.stderr
        reports: list[dict[str, Any]] = json.loads(result.stdout)
        return reports

    def reports(self) -> dict[str, dict[str, Any]]:
        """The same by host."""
        return {report["host"]: report for report in self.ask()}

    def links(self) -> dict[str, dict[str, Any]]:
        """What this host itself says of the others."""
        (own,) = [report for report in self.ask() if report["pid"] == self.process.pid]
        return {link["host"]: link for link in own["links"]}

    def linked(self, other: str) -> bool:
        return bool(self.links()[other]["state"] == "linked")

    def received(self, node: str, key: str) -> int:
        """Samples that a node, wherever it runs, says it got; 0 if it says nothing."""
        result = self.call("topic", "delay", "--json", key)
        (row,) = json.loads(result.stdout)
        return int(row["to"][node]["received"] or 0)


class Net:
    """A robot and a laptop, joined by a cable, and files for both."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.robot, self.laptop = Machine(), Machine()
        self.wire = Wire(self.robot, self.laptop)
        self.address = self.wire.addresses[0]

    def file(
        self,
        name: str = "rover",
        watcher: str = "laptop",
        more: str = "",
        at: str = "one",
        hosts: str = "",
    ) -> Path:
        """A pipeline file; `at` tells files of the two machines apart."""
        hosts = hosts or hosts_at(self.address)
        return write_file(self.folder / at, hosts, name=name, watcher=watcher, more=more)

    def close(self) -> None:
        self.robot.close()
        self.laptop.close()


@contextmanager
def two_machines() -> Iterator[Net]:
    """Machines for a test, or for several; skipped where none can be made."""
    if why := missing():
        pytest.skip(f"no network namespaces here: {why}")
    with tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True) as folder:
        made = Net(Path(folder))
        try:
            yield made
        finally:
            made.close()
