"""A folder with the test nodes, and a way to put a pipeline file beside them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

NODES = Path(__file__).parents[1] / "data/nodes"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder in which `nodes/` holds the test nodes."""
    (tmp_path / "nodes").symlink_to(NODES)
    return tmp_path


@pytest.fixture
def write(folder: Path) -> Callable[[str], Path]:
    """Puts a text where the pipeline file belongs."""

    def put(text: str) -> Path:
        file = folder / "pipeline.yaml"
        file.write_text(text)
        return file

    return put
