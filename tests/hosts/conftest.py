"""Machines for the tests of several hosts; skipped where no network namespaces can be made."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.hosts.net import Net, two_machines


@pytest.fixture
def net() -> Iterator[Net]:
    with two_machines() as made:
        yield made
