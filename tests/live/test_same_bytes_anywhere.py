"""The claim behind the node contract: own process, shared process, test: the same bytes out."""

from __future__ import annotations

import queue
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import pytest

from lodeline.bus import wait_watched
from lodeline.graph import Graph
from lodeline.node import Context
from lodeline.pipeline.load import load
from lodeline.recording.read import Recording
from lodeline.sessions import Client
from lodeline.watch import Watch
from lodeline_msgs import Message, encoding_of, pack, unpack
from tests.support.live import ROOT, Up, eventually

pytestmark = pytest.mark.paired  # waits for a recording to be over

Sent = dict[str, list[bytes]]
SAMPLES = 800
RECORDING = ROOT / "tests" / "data" / "recordings" / "rover.mcap"
PIPELINE = """
name: same
clock: recording
external: {imu/data_raw: Imu, imu/mag_raw: MagneticField, wheels: WheelTicks, reeds: ReedBar}
nodes:
  calibrate:
    run: nodes/calibrate.py
    inputs: {data_raw: imu/data_raw, mag_raw: imu/mag_raw}
    outputs: {data: imu/data, mag: imu/mag}
    params: {gyro_zero: [0.012, -0.008, 0.006]}
  attitude:
    run: nodes/attitude.py
    inputs: {data: imu/data}
    outputs: {attitude: attitude}
  odometry:
    run: nodes/odometry.py
    inputs: {wheels: wheels}
    outputs: {odom: odom}
    params: {wheel_radius: 0.0215, track: 0.112, ticks_per_turn: 16384}
  magnets:
    run: nodes/magnets.py
    inputs: {reeds: reeds}
    outputs: {magnets: magnets}
  ekf:
    run: nodes/ekf.py
    inputs: {odom: odom}
    outputs: {pose: pose}
"""
# Keys that follow a sample at once. Each node here takes one key only: what several keys bring
# is a matter of their order of arrival, which differs between processes.
FOLLOWS = {
    "imu/data_raw": ("imu/data", "attitude"),
    "imu/mag_raw": ("imu/mag",),
    "wheels": ("odom", "pose"),
    "reeds": ("magnets",),
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "same.yaml"
    path.write_text(PIPELINE)
    return path


@pytest.fixture(scope="module")
def recorded() -> list[tuple[str, bytes]]:
    """Keys and packed samples, in the order in which they were recorded."""
    found = []
    with Recording(RECORDING) as recording:
        for key, message, _ in recording.samples(FOLLOWS):
            found.append((key, pack(message)))
    return found[:SAMPLES]


def in_a_test(file: Path, recorded: list[tuple[str, bytes]], types: Mapping[str, type]) -> Sent:
    pipeline = load(file)
    graph = Graph(
        {spec.name: spec.type(spec.params, Context(spec.name)) for spec in pipeline.nodes},
        {s.name: {port: edge.key for port, edge in s.inputs.items()} for s in pipeline.nodes},
        {s.name: s.outputs for s in pipeline.nodes},
    )
    sent: Sent = {key: [] for key in graph.sent}
    for key in graph.sent:
        graph.tap(key, partial(_keep, sent[key]))
    for key, data in recorded:
        graph.deliver(f"same/{key}", unpack(data, types[key]))
    graph.close()
    return sent


def _keep(kept: list[bytes], message: Message) -> None:
    kept.append(pack(message))


def live(file: Path, recorded: list[tuple[str, bytes]], types: Mapping[str, type]) -> Sent:
    """Through processes on zenoh, in lock step: the next sample when all that follows is there."""
    sent: Sent = {}
    arrived: queue.Queue[str] = queue.Queue()

    def take(key: str, data: bytes, _encoding: str) -> None:
        sent.setdefault(key, []).append(data)
        arrived.put(key)

    with Up(file) as up:
        client = Client(up.folder)
        try:
            for key in ("imu/data", "imu/mag", "attitude", "odom", "magnets", "pose"):
                client.subscribe(f"same/{key}", 4096, take)
            publishers = {
                key: client.publisher(f"same/{key}", encoding_of(types[key])) for key in FOLLOWS
            }
            assert wait_watched(list(publishers.values()), 10.0) == []
            _wait_for_listener(up)
            for key, data in recorded:
                publishers[key].put(data)
                for _ in FOLLOWS[key]:
                    arrived.get(timeout=10.0)
        finally:
            client.close()
    assert arrived.empty()
    return sent


def _wait_for_listener(up: Up) -> None:
    """Until each node knows of our subscriptions: what it sends before is packed for nobody.

    Two statuses later it does, for they come one second apart and by the same road back.
    """
    with Watch(up.running) as watch:
        nodes = set(watch.manifest.nodes)
        first = {name: status.seq for name, status in watch.statuses(10.0).items()}
        assert set(first) == nodes

        def twice_heard() -> bool:
            now = watch.statuses(0.0)
            return all(now[name].seq >= first[name] + 2 for name in nodes)

        assert eventually(twice_heard)


def test_the_same_bytes_in_three_settings(file: Path, recorded: list[tuple[str, bytes]]) -> None:
    with Recording(RECORDING) as recording:
        types = {key: info.type for key, info in recording.channels.items() if info.type}
    expected = in_a_test(file, recorded, types)
    assert {key: len(data) for key, data in expected.items()}["same/attitude"] > 200
    assert live(file, recorded, types) == expected
    file.write_text(PIPELINE.replace("    inputs:", "    process: all\n    inputs:"))
    assert live(file, recorded, types) == expected
