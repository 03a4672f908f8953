"""Where a document is carried out: a laptop's folder, a robot's beside it, and what runs there."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from tests.docs.documents import Block, shorter
from tests.docs.stand_ins import ADDRESS, NO_NETWORK, PUSHES, another_address, programs, used
from tests.support.live import ROOT, environment, eventually

LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "dist", "*.egg-info")
SHELL = ("sh", "console")


@dataclass
class Machine:
    """A home, a run folder, and a command that stays up."""

    home: Path
    base: Path
    up: subprocess.Popen[str] | None = None
    log: list[str] = field(default_factory=list)


class Stage:
    """`with Stage(folder) as stage: faults = list(stage.do(block))`, block by block.

    The laptop's folder is a checkout with its environment, the robot's is empty.
    """

    def __init__(self, folder: Path) -> None:
        # Sockets live in the run folders: their paths are short.
        self._runs = tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True)
        runs = Path(self._runs.name)
        self.laptop = Machine(folder / "laptop", runs / "l")
        self.robot = Machine(folder / "robot", runs / "r")
        shutil.copytree(ROOT, self.laptop.home, ignore=LEFT_OUT)
        (self.laptop.home / ".venv").symlink_to(sys.prefix)
        self.robot.home.mkdir()
        for each in (self.laptop.base, self.robot.base, folder / "machine"):
            each.mkdir()
        self._address = another_address()
        path = [str(programs(folder / "bin")), str(Path(sys.executable).parent), os.environ["PATH"]]
        self._variables = {
            "PATH": os.pathsep.join(path),
            "BROWSER": "true",
            "USER": "root",
            "ROBOT": str(self.robot.home),
            "MACHINE": str(folder / "machine"),
        }

    def do(self, block: Block) -> Iterator[str]:
        """Do what a block says; what went wrong."""
        machine = self.laptop if block.says("on the robot") is None else self.robot
        for word, mode in (("file ", "w"), ("append ", "a")):
            if name := block.says(word):
                for each in (self.laptop, self.robot):
                    if (each.home / name).parent.is_dir():
                        with (each.home / name).open(mode) as stream:
                            stream.write(block.text.replace(ADDRESS, self._address))
        if block.language not in SHELL:
            return
        if command := block.says("while "):
            if machine.up is None:
                self._start(machine, command.removesuffix(" runs"))
        elif block.says("stays up") is None or machine.up is not None:
            self._end()
        wanted = int(block.says("exits ") or 0)
        folder = machine.home
        lines = block.commands
        if block.says("stays up") is not None:
            self._start(machine, lines.pop())
        for line in lines:
            if line.startswith("cd "):
                folder /= line.removeprefix("cd ")
                continue
            done = self._run(machine, line, folder)
            if done.returncode != wanted:
                yield f"`{line}` exits {done.returncode}: {done.stdout[-500:]}{done.stderr[-1500:]}"

    def _command(self, line: str) -> str:
        line = line.replace(ADDRESS, self._address)
        if line == "make test":
            line = "make --dry-run test"
        return (
            line.replace("make ", "make --old-file=.venv/.ready ", 1)
            if "make" in used(line)
            else line
        )

    def _place(self, machine: Machine, line: str, folder: Path) -> tuple[Path, dict[str, str]]:
        """Where a line runs, and its environment."""
        more = NO_NETWORK if "pip" in used(line) else {}
        variables = {**environment(machine.base), **self._variables, **more}
        if machine is self.robot:
            variables["HOME"] = str(machine.home)
        # The project's own targets need the environment that it was installed in.
        return (ROOT if line.startswith("make ") else folder), variables

    def _run(self, machine: Machine, line: str, folder: Path) -> subprocess.CompletedProcess[str]:
        """A line as a user types it, with the environment's programs on the path."""
        place, variables = self._place(machine, line, folder)
        process = subprocess.Popen(
            ["bash", "-o", "pipefail", "-c", self._command(shorter(line))],
            cwd=place,
            env=variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        said = ""
        push = next((push for start, push in PUSHES.items() if line.startswith(start)), None)
        if push is not None:
            assert process.stderr is not None
            said = process.stderr.readline()  # what is to be done
            pushed = self._run(machine, f"lodeline topic pub cmd_vel {push}", folder)
            said += pushed.stderr
        out, err = process.communicate(timeout=60)
        return subprocess.CompletedProcess(line, process.returncode, out, said + err)

    def _start(self, machine: Machine, line: str) -> None:
        """Start what stays up, and wait until it is."""
        place, variables = self._place(machine, line, machine.home)
        process = subprocess.Popen(
            ["bash", "-c", f"exec {self._command(line)}"],
            cwd=place,
            env=variables,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        machine.up, machine.log = process, []
        assert process.stderr is not None
        threading.Thread(target=machine.log.extend, args=(process.stderr,), daemon=True).start()

        def there() -> bool:
            return process.poll() is not None or any("up in " in line for line in [*machine.log])

        ready = eventually(there, 30.0)
        assert ready and process.poll() is None, f"`{line}` did not come up: {machine.log}"

    def _end(self) -> None:
        """Ctrl-C for all that stays up."""
        for machine in (self.laptop, self.robot):
            if machine.up is not None and machine.up.poll() is None:
                os.killpg(machine.up.pid, signal.SIGINT)
                machine.up.wait(20.0)
            machine.up = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        self._runs.cleanup()
