"""One pipeline, one gateway and one browser for all tests of the page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.dash.chromium import PROGRAM, Chromium
from tests.dash.support import Dash
from tests.support.live import ROOT, Up


@pytest.fixture(scope="package")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


@pytest.fixture(scope="package")
def dash(up: Up) -> Iterator[Dash]:
    made = Dash(up)
    yield made
    made.stop()


@pytest.fixture(scope="package")
def chromium() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("no chromium here: apt install chromium")
    made = Chromium()
    yield made
    made.close()
