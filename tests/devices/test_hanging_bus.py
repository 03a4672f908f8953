"""A bus that hangs under real processes: drivers keep their heartbeat, say so, and come back."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.live import ROOT, Up, eventually

PIPELINE = """
name: hang
nodes:
  simulator:
    run: {here}/nodes/hanging.py
    outputs: {{beat: beat}}
    params: {{hang_file: {file}}}
  imu:
    run: {root}/nodes/imu.py
    outputs: {{data_raw: imu/data_raw, mag_raw: imu/mag_raw}}
    process: drivers
  encoders:
    run: {root}/nodes/encoders.py
    outputs: {{wheels: wheels}}
    process: drivers
  magnet_bar:
    run: {root}/nodes/magnet_bar.py
    outputs: {{reeds: reeds}}
"""


@pytest.fixture
def up(tmp_path: Path) -> Iterator[tuple[Up, Path]]:
    file, hang = tmp_path / "pipeline.yaml", tmp_path / "hang"
    file.write_text(PIPELINE.format(here=Path(__file__).parent, root=ROOT, file=hang))
    with Up(file) as up:
        yield up, hang


def rows(up: Up) -> dict[str, dict[str, Any]]:
    said = up.call("top", "--once", "--json").stdout
    return {row["node"]: row for row in json.loads(said)}


def all_are(up: Up, fine: Callable[[dict[str, Any]], bool]) -> bool:
    found = rows(up)
    return all(fine(found[node]) for node in ("imu", "encoders", "magnet_bar"))


@pytest.mark.paired
def test_drivers_outlive_a_bus_that_hangs_for_longer_than_a_watchdog_waits(
    up: tuple[Up, Path],
) -> None:
    pipeline, hang = up
    assert eventually(lambda: all_are(pipeline, lambda row: row["state"] == "running"))
    hang.touch()
    begin = time.monotonic()
    assert eventually(lambda: all_are(pipeline, lambda row: "I2C_HANG" in row["last_error"]), 5.0)
    assert eventually(lambda: time.monotonic() - begin > 3.0)
    assert all_are(pipeline, lambda row: row["state"] == "fault")
    hang.unlink()
    assert eventually(lambda: all_are(pipeline, lambda row: row["state"] == "running"), 5.0)
    assert eventually(lambda: all_are(pipeline, lambda row: min(row["rates"].values()) > 50.0))
    assert {process["restarts"] for process in pipeline.ps().values()} == {0}
    assert not pipeline.says("NODE_SILENT")
