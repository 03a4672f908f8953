"""The lab's real runs, from text file to pose, through the programs that people use."""

from __future__ import annotations

import csv
import math
import os
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path

import pytest

Tool = Callable[[list[str]], int]
Track = list[tuple[float, float, float]]

DATA = Path(os.environ.get("LODELINE_DATA", "")) / "magnet_lab"
needs_data = pytest.mark.skipif(
    "LODELINE_DATA" not in os.environ or not DATA.is_dir(),
    reason="LODELINE_DATA names no folder with the lab's recordings",
)


@needs_data
@pytest.mark.parametrize(
    ("run", "options", "limit"),
    [
        ("line1magnet", ["--course"], 0.0026),
        ("circles", ["--course"], 0.0030),
        ("oneloop", ["--course"], 0.0030),
        ("line1magnet", [], 0.0018),
        ("circles", [], 0.0018),
        ("oneloop", [], 0.0030),
    ],
)
def test_position_of_a_real_run_is_good_to_millimetres(
    run: str, options: list[str], limit: float, tmp_path: Path, bag: Tool, replay_tool: Tool
) -> None:
    recording, tables = str(tmp_path / "run.mcap"), tmp_path / "tables"
    text = str(DATA / f"{run}.txt")
    assert bag(["import", text, "--format", "magnet-lab", *options, "-o", recording]) == 0
    assert replay_tool([recording, "--pipeline", "magnet-lab", "--csv", str(tables)]) == 0
    reference = read_track(DATA / f"reference_{run}.csv", "t_s", "x_mm", "y_mm", 1e-3)
    track = read_track(tables / "pose.csv", "stamp", "x", "y", 1.0)
    rms, used = rms_distance(track, reference)
    assert used > 30
    assert rms <= limit


def read_track(file: Path, time: str, x: str, y: str, scale: float) -> Track:
    """(t [s], x [m], y [m]) of a table."""
    with file.open(newline="") as stream:
        return [
            (float(row[time]), scale * float(row[x]), scale * float(row[y]))
            for row in csv.DictReader(stream)
        ]


def rms_distance(track: Track, reference: Track) -> tuple[float, int]:
    """Root mean square distance [m] over the common span, and of how many poses."""
    times = [t for t, _, _ in reference]
    squares = []
    for t, x, y in track:
        if not times[0] <= t <= times[-1]:
            continue
        i = min(bisect_right(times, t), len(times) - 1)
        (t0, x0, y0), (t1, x1, y1) = reference[i - 1], reference[i]
        part = (t - t0) / (t1 - t0)
        squares.append((x - x0 - part * (x1 - x0)) ** 2 + (y - y0 - part * (y1 - y0)) ** 2)
    return math.sqrt(sum(squares) / len(squares)), len(squares)
