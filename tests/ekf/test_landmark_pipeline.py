"""The claim that a pipeline file is all it takes to localise by landmarks or measured positions."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from random import Random

import pytest

from lodeline.cli import main
from lodeline.graph import Graph
from lodeline.loading import load_node, shipped
from lodeline.recording.write import RecordingWriter, whole_file
from lodeline_msgs import LandmarkDetection, Message, Odometry, PositionFix

MARKS = ((0.0, 3.0), (4.0, -1.0), (-2.0, -2.0))
MS = 1_000_000
PIPELINE = """
name: marks
clock: recording
external:
  odom: Odometry
  seen: SEEN
nodes:
  ekf:
    run: nodes/ekf.py
    inputs: {odom: odom, PORT: seen}
    outputs: {pose: pose}
    params: {magnet_model: none, initial_sigma: [0.05, 0.1]}
"""


def drive(kind: str) -> tuple[list[tuple[str, Message]], list[tuple[float, float]]]:
    """20 s of circles with noisy odometry, and what is measured 5 times a second; the truth."""
    rng = Random(6)
    noise = (0.003**2 / 0.05**2, 0.0, 0.0, 0.01**2 / 0.05**2)
    x = y = yaw = ox = oy = oyaw = 0.0
    samples: list[tuple[str, Message]] = []
    truth = []
    for i in range(400):
        stamp = 1_000 * MS + i * 50 * MS
        x, y, yaw = x + 0.02 * math.cos(yaw), y + 0.02 * math.sin(yaw), yaw + 0.03
        way, turn = 0.02 + rng.gauss(0, 0.003), 0.03 + rng.gauss(0, 0.01)
        ox, oy = ox + way * math.cos(oyaw), oy + way * math.sin(oyaw)
        oyaw = math.remainder(oyaw + turn, math.tau)
        truth.append((x, y))
        odom = Odometry(stamp, ox, oy, oyaw, 0.4, 0.6, (0.0,) * 9, noise, 0.05, seq=i)
        samples.append(("odom", odom))
        if i % 4:
            continue
        if kind == "position":
            fix = PositionFix(stamp, x + rng.gauss(0, 0.05), y + rng.gauss(0, 0.05), 0.05)
            samples.append(("seen", fix))
            continue
        east, north = (tuple(each[k] for each in MARKS) for k in (0, 1))
        ranges = tuple(math.hypot(mx - x, my - y) + rng.gauss(0, 0.05) for mx, my in MARKS)
        bearings = tuple(
            math.remainder(math.atan2(my - y, mx - x) - yaw + rng.gauss(0, 0.05), math.tau)
            for mx, my in MARKS
        )
        sigmas, nothing = (0.05,) * len(MARKS), ()
        measured = {
            "range": (ranges, sigmas, nothing, nothing),
            "bearing": (nothing, nothing, bearings, sigmas),
            "both": (ranges, sigmas, bearings, sigmas),
        }[kind]
        samples.append(("seen", LandmarkDetection(stamp, east, north, *measured)))
    return samples, truth


@pytest.mark.parametrize("kind", ["range", "bearing", "both", "position"])
def test_a_pipeline_localises_by_known_points(kind: str, tmp_path: Path) -> None:
    """Odometry alone goes more than 0.1 m astray."""
    samples, truth = drive(kind)
    bag, file = tmp_path / "run.mcap", tmp_path / "pipeline.yaml"
    fix = kind == "position"
    seen, port = ("PositionFix", "position") if fix else ("LandmarkDetection", "landmarks")
    file.write_text(PIPELINE.replace("SEEN", seen).replace("PORT", port))
    with whole_file(bag) as stream:
        writer = RecordingWriter(stream, {})
        for key, message in samples:
            writer.write(key, message)
        writer.close()
    assert main(["replay", str(bag), "--pipeline", str(file), "--csv", str(tmp_path)]) == 0
    with (tmp_path / "pose.csv").open() as table:
        poses = list(csv.DictReader(table))
    last = {round(float(row["stamp"]) * 1e3): row for row in poses}
    places = [(float(row["x"]), float(row["y"])) for row in last.values()]
    off = [math.dist(place, true) for place, true in zip(places, truth, strict=True)][100:]
    rms = math.sqrt(sum(each * each for each in off) / len(off))
    print(f"{kind}: rms {1e3 * rms:.0f} mm")
    assert rms < 0.06
    assert {row["ambiguous"] for row in poses} == {"0"}
    odometry = [(m.x, m.y) for _, m in samples if isinstance(m, Odometry)]
    assert max(map(math.dist, odometry, truth)) > 0.1


def test_a_detection_whose_arrays_differ_in_length_is_counted_not_used() -> None:
    kind = load_node(shipped("nodes") / "ekf.py")
    node = kind(kind.params_type()())
    graph = Graph({"ekf": node}, {"ekf": {"landmarks": "seen"}}, {})
    graph.deliver("seen", LandmarkDetection(1, (0.0,), (1.0,), (1.0, 2.0), (0.1,), (), ()))
    assert node.context.rejected["malformed"] == 1
