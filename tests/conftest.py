"""What tests of every kind share."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LIVE = ("dash", "live", "tools")
"""Folders whose tests start pipelines, and have deadlines."""

PAIRED = ("calibrate_verb", "faults", "hosts", "packaging", "supervisor")
"""Folders whose tests start pipelines and wait more than they work; so do tests of others that
have a pipeline `up`.
"""


@pytest.hookimpl(tryfirst=True)  # before `-m` chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what must have the machine for itself, and what at most one more may share."""
    for item in items:
        folder = item.path.relative_to(TESTS.parent).parts[1]
        if folder in LIVE and item.get_closest_marker("paired") is None:
            item.add_marker("live")
        elif item.get_closest_marker("live") is None and (
            folder in PAIRED or "up" in getattr(item, "fixturenames", ())
        ):
            item.add_marker("paired")


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """An empty folder whose path leaves room for the name of a socket, as tmp_path's may not."""
    with tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True) as folder:
        yield Path(folder)
