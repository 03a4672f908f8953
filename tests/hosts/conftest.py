"""Machines for the tests of several hosts; skipped where no network namespaces can be made."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from lodeline.bench.machines import missing
from tests.hosts.net import Net


@pytest.fixture
def net() -> Iterator[Net]:
    if why := missing():
        pytest.skip(f"no network namespaces here: {why}")
    with tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True) as folder:
        made = Net(Path(folder))
        yield made
        made.close()
