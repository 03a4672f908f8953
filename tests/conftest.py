"""What tests of every kind share."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """An empty folder whose path leaves room for the name of a socket, as tmp_path's may not."""
    with tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True) as folder:
        yield Path(folder)
