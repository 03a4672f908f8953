"""Two recordings for all tests of plots: a robot of the magnet lab, and a simulated one."""

from __future__ import annotations

from pathlib import Path

import pytest

from lodeline.cli import main
from tests.dash.conftest import chromium  # noqa: F401 - the browser is a fixture here too
from tests.support.live import ROOT

RECORDINGS = ROOT / "tests" / "data" / "recordings"


@pytest.fixture(scope="package")
def rover(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four seconds of the simulated robot, with truth, attitude and gyro bias; tables beside it."""
    folder = tmp_path_factory.mktemp("rover")
    out = folder / "rover.mcap"
    line = ["replay", str(RECORDINGS / "rover.mcap"), "--pipeline", str(ROOT / "pipeline.yaml")]
    line += ["--set", "attitude.method=mekf", "-o", str(out), "--csv", str(folder / "tables")]
    assert main(line) == 0
    return out


@pytest.fixture(scope="package")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A loop over magnets, each row a sighting of its own, as the lab takes it."""
    folder = tmp_path_factory.mktemp("loop")
    bag, out = folder / "bag.mcap", folder / "loop.mcap"
    text = RECORDINGS / "loop.txt"
    assert main(["bag", "import", str(text), "--format", "magnet-lab", "-o", str(bag)]) == 0
    line = ["replay", str(bag), "--pipeline", "magnet-lab", "-o", str(out)]
    assert main([*line, "--set", "ekf.magnet_model=plain"]) == 0
    return out
