"""Claims about the default pipeline as a user starts it: live processes on zenoh."""

from __future__ import annotations

import json
import math
import os
import signal
import threading
import time
from collections.abc import Iterator

import pytest

from lodeline.sessions import Client
from lodeline_msgs import Odometry, PoseEstimate, unpack
from tests.support.live import ROOT, Up, eventually, living, lodeline

DRIVERS = ["simulator", "imu", "encoders", "magnet_bar"]
NODES = [*DRIVERS, "calibrate", "attitude", "odometry", "magnets", "ekf"]


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


class Listener:
    """Counts what comes on the keys of a pipeline, and keeps the samples of those asked for."""

    def __init__(self, up: Up) -> None:
        self._client = Client(up.folder)
        self._lock = threading.Lock()
        self.counts: dict[str, int] = {}
        self.poses: list[PoseEstimate] = []
        self.truths: list[Odometry] = []
        self.odometry: list[Odometry] = []
        self._client.subscribe("rover/**", 1024, self._take)

    def _take(self, key: str, data: bytes, _encoding: str) -> None:
        with self._lock:
            self.counts[key] = self.counts.get(key, 0) + 1
            if key == "rover/pose":
                self.poses.append(unpack(data, PoseEstimate))
            elif key == "rover/truth":
                self.truths.append(unpack(data, Odometry))
            elif key == "rover/odom":
                self.odometry.append(unpack(data, Odometry))

    def count(self, key: str) -> int:
        with self._lock:
            return self.counts.get(key, 0)

    def close(self) -> None:
        self._client.close()


@pytest.fixture(scope="module")
def listener(up: Up) -> Iterator[Listener]:
    heard = Listener(up)
    yield heard
    heard.close()


def rms_error(estimates: list[PoseEstimate], truths: list[Odometry]) -> float:
    """RMS distance [m] of poses from the truth, interpolated at their stamps."""
    squares = []
    place = 0
    for pose in estimates:
        while place + 1 < len(truths) and truths[place + 1].stamp < pose.stamp:
            place += 1
        if place + 1 == len(truths) or pose.stamp < truths[place].stamp:
            continue
        a, b = truths[place], truths[place + 1]
        part = (pose.stamp - a.stamp) / (b.stamp - a.stamp)
        x, y = a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)
        squares.append((pose.x - x) ** 2 + (pose.y - y) ** 2)
    assert len(squares) > 100
    return math.sqrt(sum(squares) / len(squares))


def test_every_key_comes_at_its_rate(up: Up) -> None:
    def rates() -> dict[str, float]:
        result = up.call("topic", "hz", "--json")
        assert result.returncode == 0, result.stderr
        return {row["key"]: row["rate"] or 0.0 for row in json.loads(result.stdout)}

    # The first status covers the start too; on a busy machine a second may be a bad one.
    wanted = {"imu/data_raw": 200, "imu/data": 200, "attitude": 200, "odom": 100, "truth": 50}
    assert eventually(
        lambda: all(abs(rates()[key] - hz) < 0.05 * hz for key, hz in wanted.items()), 20.0, 0.5
    ), rates()
    assert rates()["pose"] >= 20.0


def test_topic_list_names_every_key_with_class_and_source(up: Up) -> None:
    result = up.call("topic", "list", "--json")
    keys = {row["key"]: (row["class"], row["node"]) for row in json.loads(result.stdout)}
    assert keys["pose"] == ("PoseEstimate", "ekf")
    assert keys["imu/data_raw"] == ("Imu", "imu")
    assert keys["cmd_vel"] == ("Twist", None)
    assert len(keys) == 12


def test_echo_prints_what_zenoh_carries(up: Up) -> None:
    result = up.call("topic", "echo", "pose", "-n", "3", "--json", "--timeout", "10")
    samples = [json.loads(line) for line in result.stdout.splitlines()]
    assert result.returncode == 0
    assert len(samples) == 3
    assert [sample["seq"] - samples[0]["seq"] for sample in samples] == [0, 1, 2]
    text = up.call("topic", "echo", "data_raw", "-n", "1", "--timeout", "10").stdout
    assert "linear_acceleration: [" in text
    assert "m/s^2" in text


def test_a_wrong_key_names_the_nearest(up: Up) -> None:
    result = up.call("topic", "echo", "poze")
    assert result.returncode == 4
    assert "did you mean 'pose'?" in result.stderr


def test_the_ekf_stays_with_the_truth_where_odometry_drifts(listener: Listener) -> None:
    assert eventually(lambda: listener.count("rover/pose") > 1500, 30.0)
    poses, truths = list(listener.poses), list(listener.truths)
    assert rms_error(poses, truths) < 0.010


@pytest.mark.parametrize("node", NODES)
def test_a_killed_node_is_back_within_two_seconds(up: Up, listener: Listener, node: str) -> None:
    before = up.ps()
    keys = [
        f"rover/{row['key']}"
        for row in json.loads(up.call("topic", "list", "--json").stdout)
        if row["node"] == node
    ]
    os.kill(before[node]["pid"], signal.SIGKILL)
    killed = time.monotonic()
    assert eventually(lambda: up.ps()[node]["pid"] not in (None, before[node]["pid"]), 2.0)
    counts = {key: listener.count(key) for key in keys}
    # Samples that were under way when it died may still come in; ten are its successor's.
    assert eventually(
        lambda: all(listener.count(key) > counts[key] + 10 for key in keys),
        2.0 - (time.monotonic() - killed),
    ), "no samples within 2 s"
    after = up.ps()
    assert after[node]["restarts"] == before[node]["restarts"] + 1
    assert all(after[other]["pid"] == before[other]["pid"] for other in NODES if other != node)


def test_after_all_these_kills_the_pose_is_still_true_or_says_since_when_it_may_not_be(
    up: Up, listener: Listener
) -> None:
    """Encoders that were away for more than half a turn, on a busy machine, have left a gap that
    nobody measured.
    """
    seen = listener.count("rover/pose")
    assert eventually(lambda: listener.count("rover/pose") > seen + 300, 15.0)
    poses = listener.poses[-300:]
    odom = up.call("topic", "echo", "odom", "-n", "1", "--json", "--timeout", "10").stdout
    announced = json.loads(odom)["resets"] > 0 and all(pose.ambiguous for pose in poses)
    if announced:  # then the doubt is as large as the error
        sigma = max(max(pose.covariance[0], pose.covariance[4]) for pose in poses) ** 0.5
        assert rms_error(poses, listener.truths) < 3.0 * sigma + 0.015
    else:
        assert rms_error(poses, listener.truths) < 0.015


def test_ctrl_c_stops_all_with_130() -> None:
    with Up(ROOT / "pipeline.yaml") as up:
        marker = str(up.folder)
        assert len(living(marker)) >= len(NODES)
        assert up.stop(signal.SIGINT) == 130
        assert living(marker) == []


def test_a_killed_supervisor_leaves_no_process_behind() -> None:
    with Up(ROOT / "pipeline.yaml") as up:
        marker = str(up.folder)
        up.process.kill()
        up.process.wait()
        assert eventually(lambda: living(marker) == [], 1.0)


def test_without_a_pipeline_tools_say_so_with_exit_4(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    run = tmp_path_factory.mktemp("r")
    for arguments in (("topic", "list"), ("topic", "hz"), ("topic", "echo", "pose"), ("ps",)):
        result = lodeline(*arguments, run=run)
        assert result.returncode == 4, arguments
        assert result.stderr
        assert not result.stdout
