"""What tests of every kind share."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LIVE = (
    "calibrate_verb",
    "dash",
    "docs",
    "faults",
    "hosts",
    "live",
    "packaging",
    "supervisor",
    "tools",
)
"""Folders whose tests start pipelines, and have deadlines."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """With several workers, one takes what is live, test by test, and the other all else."""
    live = [item for item in items if item.path.relative_to(TESTS.parent).parts[1] in LIVE]
    for item in live:
        item.add_marker(pytest.mark.xdist_group("live"))
    chosen = set(live)
    items.sort(key=lambda item: item not in chosen)


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """An empty folder whose path leaves room for the name of a socket, as tmp_path's may not."""
    with tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True) as folder:
        yield Path(folder)
