"""What the README says beside its commands: the two of the Makefile, the diagram, the robot."""

from __future__ import annotations

import re

import pytest

from lodeline import cli
from lodeline.pipeline.load import load
from tests.docs.documents import blocks
from tests.support.live import ROOT


def test_the_first_two_commands_are_the_ones_of_the_makefile() -> None:
    first = [line for block in blocks("README.md")[:2] for line in block.text.splitlines()]
    assert first == ["make demo", "make test"]
    makefile = (ROOT / "Makefile").read_text()
    assert re.search(r"^demo:", makefile, re.MULTILINE)
    assert re.search(r"^test:", makefile, re.MULTILINE)


def test_the_diagram_is_the_default_pipeline_as_graph_draws_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    (drawn,) = [block.text for block in blocks("README.md") if block.language == "mermaid"]
    assert cli.main(["graph", str(ROOT / "pipeline.yaml"), "--mermaid"]) == 0
    assert drawn == capsys.readouterr().out


def test_the_default_pipeline_becomes_a_robots_by_three_words() -> None:
    text = (ROOT / "pipeline.yaml").read_text()
    assert text.count("bus: sim,") == 3
    file = ROOT / "pipeline.yaml"
    robot = load(file, [f"{node}.bus=1" for node in ("imu", "encoders", "magnet_bar")])
    drivers = [spec for spec in robot.nodes if spec.is_driver and spec.name != "simulator"]
    assert [spec.params.bus for spec in drivers] == [1, 1, 1]


def test_the_example_is_the_one_that_the_ten_steps_show() -> None:
    (shown,) = [b.text for b in blocks("docs/add-a-node.md") if b.language == "python"]
    assert shown == (ROOT / "examples" / "go_to_goal" / "go_to_goal.py").read_text()
