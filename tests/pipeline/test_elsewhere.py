"""Claims about a pipeline that is read in a process of its own: all of it comes, and no more."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from lodeline.pipeline.elsewhere import Reading
from lodeline.pipeline.faults import PipelineError
from lodeline.pipeline.load import load

RIG = Path(__file__).parents[1] / "data" / "rig.yaml"
READ = """
import sys
from lodeline.pipeline.elsewhere import Reading
found = Reading(sys.argv[1], []).pipeline()
print(*found.nodes[0].sends.values(), found.digest)
print(*(name for name in sys.modules if name.startswith(("ruamel", "lodeline_node"))))
"""
OWN_MESSAGE = """
from dataclasses import dataclass
from typing import Annotated
from lodeline.node import Driver, Output
from lodeline_msgs import Message, Unit, message

@message
class Smell(Message):
    strength: Annotated[float, Unit("1")]

@dataclass(frozen=True, slots=True)
class NoseParams:
    rate: Annotated[float, "Hz"] = 10.0

class Nose(Driver[NoseParams]):
    smell = Output(Smell)
    def tick(self, stamp: int) -> None:
        self.smell.send(Smell(stamp, 1.0))
"""


def start(file: Path) -> subprocess.Popen[str]:
    """A process that has a file read and says what it has of it."""
    command = [sys.executable, "-P", "-c", READ, str(file)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def pipeline_of(folder: Path, program: str) -> Path:
    """A file with one node, which is that program."""
    (folder / "nose.py").write_text(program)
    file = folder / "nose.yaml"
    file.write_text("name: nose\nnodes:\n  nose: {run: nose.py, outputs: {smell: smell}}\n")
    return file


def test_it_is_the_pipeline_without_its_programs() -> None:
    assert Reading(str(RIG), []).pipeline() == load(RIG).without_programs()


def test_neither_yaml_nor_programs_stay_with_who_wanted_it() -> None:
    reader = start(RIG)
    out, err = reader.communicate(timeout=20)
    assert reader.returncode == 0, err
    found, modules, rest = out.split("\n")
    assert load(RIG).digest in found
    assert (modules, rest) == ("", "")


def test_everything_that_is_wrong_comes_through(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("name: bad\nnodes:\n  a: {run: nothing.py}\n  b: {runs: b.py}\n")
    with pytest.raises(PipelineError) as here:
        load(file)
    with pytest.raises(PipelineError) as elsewhere:
        Reading(str(file), []).pipeline()
    assert len(here.value.faults) > 1
    assert elsewhere.value.faults == here.value.faults


def test_a_message_that_a_program_defines_for_itself_is_known(tmp_path: Path) -> None:
    out, err = start(pipeline_of(tmp_path, OWN_MESSAGE)).communicate(timeout=20)
    assert "Smell" in out, err


def test_a_program_that_aborts_is_told_of(tmp_path: Path) -> None:
    reader = start(pipeline_of(tmp_path, "import os\nos.abort()\n"))
    _, err = reader.communicate(timeout=20)
    assert reader.returncode == 1
    assert "SIGABRT" in err


def test_a_program_that_hangs_dies_with_who_wanted_the_pipeline(tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    program = (
        "import os, pathlib, time\n"
        f"pathlib.Path({str(pid_file)!r}).write_text(str(os.getpid()))\n"
        "time.sleep(15)\n"
    )
    reader = start(pipeline_of(tmp_path, program))
    end = time.monotonic() + 20.0
    while not (pid_file.exists() and pid_file.read_text()):
        assert time.monotonic() < end
        time.sleep(0.01)
    began = time.monotonic()
    reader.kill()
    reader.communicate(timeout=20)  # its pipes end only when both are gone
    assert time.monotonic() - began < 5.0
