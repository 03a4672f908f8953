"""Claims about docs/reliability.md: each promise names tests that exist, and their strength."""

from __future__ import annotations

import ast
import re

import pytest

from tests.support.live import ROOT

TABLE = ROOT / "docs" / "reliability.md"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in TABLE.read_text(encoding="utf-8").splitlines()
    if line.startswith("| ") and not line.startswith("| Promise")
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:50])
def test_a_promise_has_tests_that_exist_and_a_strength(row: list[str]) -> None:
    promise, tests, strength, _gap = row
    assert promise
    assert strength in ("contract", "smoke")
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", tests)
    assert len(named) == tests.count("`") // 2 > 0
    for file, name in named:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        names = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        is_test = name.startswith("test_") and name in names
        assert not name or is_test, f"{file} has no {name}"


def test_the_table_is_not_empty() -> None:
    assert len(ROWS) > 40
