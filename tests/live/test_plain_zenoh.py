"""The claim of proto/README.md: ten lines of zenoh and msgpack read any key."""

from __future__ import annotations

import os
import re
import subprocess
import sys

from lodeline_msgs import PoseEstimate, field_specs
from tests.support.live import ROOT, Up

README = ROOT / "proto" / "README.md"


def program() -> str:
    """The one Python block of the page."""
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    return str(code)


def test_the_program_is_ten_lines_and_knows_nothing_of_lodeline() -> None:
    assert len([line for line in program().splitlines() if line]) == 10
    assert "lodeline" not in "".join(re.sub(r"#.*", "", program()))


def test_the_program_prints_the_pose_of_a_running_pipeline() -> None:
    with Up(ROOT / "pipeline.yaml") as up:
        reader = subprocess.Popen(
            [sys.executable, "-c", program(), str(up.folder / "hub.sock"), "rover/pose"],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        assert reader.stdout is not None
        line = reader.stdout.readline()
        reader.kill()
        reader.wait()
    assert line.startswith("application/msgpack;PoseEstimate {'stamp': ")
    assert all(f"'{spec.name}': " in line for spec in field_specs(PoseEstimate))
