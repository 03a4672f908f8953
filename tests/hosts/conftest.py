"""Machines for the tests of several hosts; skipped where no network namespaces can be made."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from lodeline.bench.pair import make_keys
from tests.hosts.net import Net, two_machines


@pytest.fixture
def net() -> Iterator[Net]:
    with two_machines() as made:
        yield made


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    """A folder of keys: an authority, a robot that is at `net`'s address and here, a laptop."""
    pytest.importorskip("cryptography")
    folder = tmp_path / "keys"
    make_keys(folder, "10.213.1.1", "127.0.0.1")
    return folder
