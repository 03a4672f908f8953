"""The claim that what the documents say can be done as they say it, command by command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lodeline.calibration_file import load
from tests.docs.documents import DOCUMENTS, ELSEWHERE, LANGUAGES, PRINTED, anchors, blocks, links
from tests.docs.stage import SHELL, Stage
from tests.docs.stand_ins import STAND_INS, used

LIVE = ("lodeline up", "make demo", "lodeline demo")
ORDERS = ("exits", "file", "append", "on the robot", "stays up", "while")


def with_commands() -> list[Any]:
    """The documents to carry out; those that start a pipeline run two at a time."""
    found = []
    for name in DOCUMENTS:
        lines = [
            line for block in blocks(name) if block.language in SHELL for line in block.commands
        ]
        live = any(line.startswith(LIVE) for line in lines)
        if lines:
            found.append(pytest.param(name, marks=[pytest.mark.paired] if live else []))
    return found


@pytest.mark.parametrize("document", with_commands())
def test_every_command_does_what_is_said(document: str, tmp_path: Path) -> None:
    with Stage(tmp_path) as stage:
        wrong = [
            f"{document}:{block.line}: {text}"
            for block in blocks(document)
            for text in stage.do(block)
        ]
    assert not wrong, "\n".join(wrong)
    if document == "docs/robot.md":
        was_calibrated(stage.laptop.home / "calibration.yaml")


def was_calibrated(file: Path) -> None:
    """What the page's robot was measured to be is what the simulated one is."""
    found = load(file).sections
    assert found["wheels"]["wheel_radius"] == pytest.approx(0.041, rel=0.1)
    assert found["wheels"]["track"] == pytest.approx(0.402, rel=0.1)
    assert found["gyro"]["gyro_zero"] == pytest.approx([0.0] * 3, abs=0.05)
    assert {"gyro", "mag", "wheels"} <= set(found)


def test_what_stands_in_for_something_is_all_in_one_table_and_needed() -> None:
    lines = [
        line
        for name in DOCUMENTS
        for b in blocks(name)
        if b.language in SHELL
        for line in b.commands
    ]
    assert {word for line in lines for word in used(line)} == set(STAND_INS)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_blocks_and_their_orders_are_of_a_known_kind(document: str) -> None:
    """What is not known would be left out in silence; so would a command among printed lines."""
    for block in blocks(document):
        assert block.language in LANGUAGES
        assert not block.order or all(each.startswith(ORDERS) for each in block.order.split(", "))
        printed = block.text.splitlines() if block.language in PRINTED else []
        assert not printed or not all(
            each.startswith(("lodeline ", "make ", "$ ")) for each in printed
        )


@pytest.mark.parametrize("document", [*DOCUMENTS, *ELSEWHERE, "proto/README.md"])
def test_links_lead_somewhere(document: str) -> None:
    dead = [
        f"{path}#{anchor}"
        for path, anchor in links(document)
        if not path.exists() or (anchor and anchor not in anchors(path))
    ]
    assert not dead
