"""Claims about samples that are lost, on a simulated robot's recording that is edited.

The robot of the default pipeline drives its bends; then samples of the IMU, the encoders and the
bar are taken out, and the estimators see what is left.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest

from lodeline import virtual
from lodeline.graph import Graph
from lodeline.node import Context
from lodeline.pipeline.load import load
from lodeline.pipeline.model import Pipeline
from lodeline_msgs import Message, Odometry, PoseEstimate

PIPELINE = Path(__file__).parents[2] / "pipeline.yaml"
SECONDS, NANO = 24.0, 1_000_000_000
ESTIMATORS = ("attitude", "odometry", "magnets", "ekf")
IMU, WHEELS, REEDS = ("rover/imu/data", "rover/imu/mag"), ("rover/wheels",), ("rover/reeds",)
Sample = tuple[str, Message]


@pytest.fixture(scope="module")
def pipeline() -> Pipeline:
    return load(PIPELINE)


@pytest.fixture(scope="module")
def recording(pipeline: Pipeline, tmp_path_factory: pytest.TempPathFactory) -> list[Sample]:
    """What the drivers send, the IMU calibrated, and the truth."""
    keys = {*IMU, *WHEELS, *REEDS, "rover/truth"}
    samples: list[Sample] = []

    def listen(key: str, message: Message) -> None:
        if key in keys:
            samples.append((key, message))

    virtual.run(pipeline, SECONDS, tmp_path_factory.mktemp("run"), listen)
    return samples


def thinned(samples: list[Sample], keys: tuple[str, ...], share: float) -> list[Sample]:
    """Without a random `share` of the samples of these keys."""
    rng = Random(1)
    return [each for each in samples if each[0] not in keys or rng.random() >= share]


def with_holes(
    samples: list[Sample], keys: tuple[str, ...], shortest: float, longest: float, every: float
) -> list[Sample]:
    """Without any sample of these keys over holes [s], with about `every` [s] between them."""
    rng, holes, at = Random(2), [], 3.0
    start = samples[0][1].stamp
    while at < SECONDS:
        end = at + rng.uniform(shortest, longest)
        holes.append((start + at * NANO, start + end * NANO))
        at = end + rng.uniform(0.5, 1.5) * every
    return [
        (key, message)
        for key, message in samples
        if key not in keys or not any(a <= message.stamp < b for a, b in holes)
    ]


class Score(NamedTuple):
    """RMS error [m, rad], and of how many poses what is true [share]."""

    position: float
    heading: float
    sure_and_wrong: float
    ambiguous: float
    beyond_three_sigma: float


def graph_of(
    pipeline: Pipeline, names: tuple[str, ...], folder: Path, attitude: str = "attitude"
) -> Graph:
    """Some nodes of the pipeline, wired; `attitude` is what the EKF reads as such."""
    specs = [spec for spec in pipeline.nodes if spec.name in names]
    inputs = {spec.name: {port: edge.key for port, edge in spec.inputs.items()} for spec in specs}
    if "ekf" in inputs:
        inputs["ekf"]["attitude"] = f"rover/{attitude}"
    return Graph(
        {spec.name: spec.type(spec.params, Context(spec.name, folder)) for spec in specs},
        inputs,
        {spec.name: spec.outputs for spec in specs},
        _fail,
    )


def scored(
    pipeline: Pipeline, samples: list[Sample], folder: Path, attitude: str = "attitude"
) -> Score:
    """The default estimators over these samples; without `attitude` the ekf has no gyro."""
    graph = graph_of(pipeline, ESTIMATORS, folder, attitude)
    poses: list[Message] = []
    graph.tap("rover/pose", poses.append)
    truth = [message for _, message in samples if isinstance(message, Odometry)]
    for key, message in samples:
        if key in graph.outside:
            graph.deliver(key, message)
    return _score(poses, truth)


def _fail(name: str, message: Message, error: Exception) -> None:
    raise AssertionError(f"{name} could not take {message}") from error


def _score(poses: Sequence[Message], truth: list[Odometry]) -> Score:
    stamps = [each.stamp for each in truth]
    count = 0
    sums = [0.0] * 5
    for pose in poses:
        assert isinstance(pose, PoseEstimate)
        i = bisect_left(stamps, pose.stamp)
        if not 0 < i < len(truth):
            continue
        a, b = truth[i - 1], truth[i]
        share = (pose.stamp - a.stamp) / (b.stamp - a.stamp)
        off = math.hypot(pose.x - a.x - share * (b.x - a.x), pose.y - a.y - share * (b.y - a.y))
        yaw = a.yaw + share * math.remainder(b.yaw - a.yaw, math.tau)
        turned = abs(math.remainder(pose.yaw - yaw, math.tau))
        wrong = off > 0.0275
        sure = not pose.ambiguous
        beyond = turned > 3.0 * math.sqrt(pose.covariance[8])
        for k, value in enumerate((off**2, turned**2, wrong and sure, pose.ambiguous, beyond)):
            sums[k] += value
        count += 1
    position, heading, *shares = (each / count for each in sums)
    return Score(math.sqrt(position), math.sqrt(heading), *shares)


EDITS: dict[str, Callable[[list[Sample]], list[Sample]]] = {
    "nothing": lambda samples: samples,
    "half of the IMU": partial(thinned, keys=IMU, share=0.5),
    "nine in ten of the IMU": partial(thinned, keys=IMU, share=0.9),
    "holes in the IMU": partial(with_holes, keys=IMU, shortest=0.05, longest=0.5, every=1.0),
    "holes in the encoders": partial(with_holes, keys=WHEELS, shortest=0.1, longest=1.0, every=2.0),
    "holes in encoders and bar": partial(
        with_holes, keys=(*WHEELS, *REEDS), shortest=0.1, longest=1.0, every=2.0
    ),
    "holes in all": partial(
        with_holes, keys=(*IMU, *WHEELS, *REEDS), shortest=0.1, longest=1.0, every=2.0
    ),
    "four in five of all": partial(thinned, keys=(*IMU, *WHEELS, *REEDS), share=0.8),
}


@pytest.fixture
def edited(request: pytest.FixtureRequest, recording: list[Sample]) -> Iterator[list[Sample]]:
    yield EDITS[request.param](recording)


@pytest.mark.parametrize("edited", EDITS, indirect=True)
def test_whatever_is_lost_no_pose_is_sure_and_wrong_and_the_gyro_never_harms(
    edited: list[Sample], pipeline: Pipeline, tmp_path: Path
) -> None:
    """A gap is no turn: what the gyro may have missed is in its doubt."""
    wheels = scored(pipeline, edited, tmp_path, attitude="nobody")
    gyro = scored(pipeline, edited, tmp_path)
    for name, score in (("wheels", wheels), ("gyro", gyro)):
        print(
            f"{name}: {1e3 * score.position:.2f} mm, {math.degrees(score.heading):.2f} deg, "
            f"ambiguous {100 * score.ambiguous:.1f} %"
        )
        assert score.sure_and_wrong == 0.0
        assert score.beyond_three_sigma <= 0.01
        assert score.position < 0.005
    assert gyro.heading <= wheels.heading
    assert gyro.position <= 1.1 * wheels.position
    assert gyro.ambiguous <= wheels.ambiguous


@pytest.fixture(scope="module")
def estimates(
    pipeline: Pipeline, recording: list[Sample], tmp_path_factory: pytest.TempPathFactory
) -> list[Sample]:
    """What the EKF gets, and the truth."""
    folder, samples = tmp_path_factory.mktemp("run"), list[Sample]()
    graph = graph_of(pipeline, ("attitude", "odometry", "magnets"), folder)
    for key in graph.sent:
        graph.tap(key, partial(lambda key, message: samples.append((key, message)), key))
    for key, message in recording:
        if key == "rover/truth":
            samples.append((key, message))
        graph.deliver(key, message)
    return samples


@pytest.mark.parametrize("gap", [2.6, 6.0])
def test_a_restored_ekf_that_gets_nothing_of_what_it_missed_is_less_sure_and_holds_the_truth(
    gap: float, estimates: list[Sample], pipeline: Pipeline, tmp_path: Path
) -> None:
    """As after a kill whose gap is longer than what senders keep, or that nobody answers for."""
    truth = [m for key, m in estimates if key == "rover/truth" and isinstance(m, Odometry)]
    for killed in (4.0, 9.3):
        begin, end = (truth[0].stamp + round(at * NANO) for at in (killed, killed + gap))
        lives = [graph_of(pipeline, ("ekf",), tmp_path) for _ in range(2)]
        said: tuple[list[PoseEstimate], ...] = ([], [])
        for life, poses in zip(lives, said, strict=True):
            life.tap("rover/pose", poses.append)
        node, successor = (life.nodes["ekf"] for life in lives)
        for key, message in estimates:
            if key != "rover/truth" and message.stamp < begin:
                lives[0].deliver(key, message)
                if message.stamp < begin - 200_000_000:  # a state is that old at most
                    saved = node.save()
        successor.resume(saved)
        for key, message in estimates:
            if key != "rover/truth" and message.stamp >= end:
                lives[1].deliver(key, message)
        before, after = said[0][-1], said[1][0]
        for place in (0, 4, 8):
            assert after.covariance[place] > before.covariance[place]
        score = _score(said[1], truth)
        print(f"{gap} s from {killed} s on: {1e3 * score.position:.1f} mm, {score.ambiguous:.1%}")
        assert score.sure_and_wrong == 0.0
        assert score.beyond_three_sigma <= 0.01
        assert score.position < 0.005
