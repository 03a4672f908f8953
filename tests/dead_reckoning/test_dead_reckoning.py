"""Claims about dead reckoning by IMU: exact without errors, quadratic with them, saved by stops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import cos, pi, sin
from random import Random
from typing import Any

import msgpack
import pytest

from lodeline.dead_reckoning import DeadReckoning, DeadReckoningParams
from lodeline.graph import Graph
from lodeline.loading import load_node, shipped
from lodeline.rotation import Vector, conjugate, from_euler, multiply, rotate
from lodeline_msgs import Imu, Message, Odometry

DT = 0.01
PUSH = 0.5  # m/s^2
BIAS: Vector = (0.01, -0.02, 0.015)
Sample = tuple[Vector, Vector]


def legs(rest: float = 1.5, turns: int = 0) -> Iterator[tuple[float, float]]:
    """(forward acceleration, yaw rate) of: rest, a leg of 0.5 m, turn and leg again, rest."""

    def hold(seconds: float, push: float, rate: float) -> Iterator[tuple[float, float]]:
        return iter([(push, rate)] * round(seconds / DT))

    yield from hold(rest, 0.0, 0.0)
    for turn in range(turns + 1):
        yield from hold(1.0, PUSH, 0.0)
        yield from hold(1.0, -PUSH, 0.0)
        yield from hold(1.0, 0.0, 0.0)
        if turn < turns:
            yield from hold(1.0, 0.0, 0.5 * pi)
            yield from hold(1.0, 0.0, 0.0)


def readings(
    motion: Iterator[tuple[float, float]],
    tilt: float = 0.0,
    bias: Vector = BIAS,
    offset: float = 0.0,
    noise: float = 0.0,
) -> Iterator[Sample]:
    rng = Random(4)
    yaw = 0.0
    mounted = from_euler(0.0, tilt, 0.0)
    for push, rate in motion:
        yaw += rate * DT
        back = conjugate(multiply(from_euler(0.0, 0.0, yaw), mounted))
        x, y, z = rotate(back, (push * cos(yaw), push * sin(yaw), 9.80665))
        w = rotate(back, (0.0, 0.0, rate))
        yield (
            (w[0] + bias[0], w[1] + bias[1], w[2] + bias[2]),
            (x + offset + rng.gauss(0.0, noise), y, z),
        )


def run(samples: Iterator[Sample], **params: float | bool) -> DeadReckoning:
    reckoning = DeadReckoning(DeadReckoningParams(**params))  # type: ignore[arg-type]
    for i, (w, a) in enumerate(samples):
        reckoning.update(DT if i else 0.0, w, a)
    return reckoning


@pytest.mark.parametrize("stops", [False, True])
def test_a_leg_driven_by_a_good_sensor_has_its_length(stops: bool) -> None:
    """The complementary filter takes some of the push for tilt: 1 % of a second's worth."""
    end = run(readings(legs()), zero_velocity=stops, tau=1e4).estimate
    assert end.x == pytest.approx(0.5, abs=0.01)
    assert end.y == pytest.approx(0.0, abs=0.005)
    assert end.v == pytest.approx(0.0, abs=0.01)


def test_the_zero_point_of_the_gyro_is_taken_at_rest() -> None:
    with_rest = run(readings(legs(turns=4)), zero_velocity=True).estimate
    assert with_rest.yaw == pytest.approx(0.0, abs=0.02)  # four quarter turns
    without = run(readings(legs(turns=4)), zero_time=0.0).estimate
    assert abs(without.yaw) > 0.2


def test_gravity_of_a_tilted_sensor_is_compensated() -> None:
    end = run(readings(legs(), tilt=0.1), zero_velocity=False, tau=1e4).estimate
    assert end.x == pytest.approx(0.5, abs=0.02)


def test_a_square_ends_where_it_began() -> None:
    end = run(readings(legs(turns=3), noise=0.02), tau=1e4).estimate
    assert (end.x, end.y) == pytest.approx((0.0, 0.0), abs=0.06)


def test_an_error_of_the_accelerometer_grows_with_the_square_of_time_unless_there_are_stops() -> (
    None
):
    """It comes on after the zero point was taken, as the warmth of a motor does."""

    def drifting(seconds: float) -> Iterator[Sample]:
        yield from readings(iter([(0.0, 0.0)] * 200))
        yield from readings(iter([(0.0, 0.0)] * round(seconds / DT)), offset=0.05)

    short, long = (run(drifting(t), zero_velocity=False, tau=1e6).estimate.x for t in (5.0, 10.0))
    assert short == pytest.approx(0.5 * 0.05 * 5.0**2, rel=0.02)
    assert long / short == pytest.approx(4.0, rel=0.02)
    stopped = run(drifting(10.0), zero_velocity=True, tau=1e6).estimate
    assert abs(stopped.x) < 0.01


def test_the_stated_sigma_holds_the_error_of_a_drive() -> None:
    end = run(readings(legs(turns=3), noise=0.02, offset=0.02)).estimate
    sigma = end.pose_covariance[0] ** 0.5
    assert 0.05 < sigma < 2.0
    assert abs(end.x) < 3.0 * sigma
    assert abs(end.y) < 3.0 * sigma


def test_moving_at_once_does_not_spoil_the_zero_point() -> None:
    """Half a second of rest where a second was asked for."""
    end = run(readings(legs(rest=0.5), bias=BIAS), tau=1e4).estimate
    assert end.x == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("half", [40, 260, 420])
def test_handing_over_the_state_half_way_changes_nothing(half: int) -> None:
    samples = list(readings(legs(turns=1), noise=0.02))
    through = run(iter(samples))
    first = run(iter(samples[:half]))
    second = DeadReckoning(first.params)
    second.resume(first.state)
    for w, a in samples[half:]:
        second.update(DT, w, a)
    assert second.estimate == through.estimate
    assert second.state == through.state


def test_a_hole_in_the_samples_moves_nothing_and_is_owned_up_to() -> None:
    reckoning = run(iter(list(readings(legs(), bias=(0.0, 0.0, 0.0)))[:220]), tau=1e4)  # in a push
    before = reckoning.estimate
    assert before.v > 0.3
    reckoning.update(3.0, (0.0, 0.0, 0.0), (PUSH, 0.0, 9.80665))
    after = reckoning.estimate
    assert (after.x, after.y, after.v) == pytest.approx((before.x, before.y, before.v), abs=1e-6)
    assert after.pose_covariance[0] ** 0.5 > 3.0 * before.v
    assert after.pose_covariance[8] ** 0.5 > 1.0


def test_a_node_restarted_in_mid_run_goes_on_as_if_nothing_had_been() -> None:
    """Its state goes through the file that a crash leaves behind."""
    node = load_node(shipped("nodes") / "dead_reckoning.py")
    samples = list(readings(legs(turns=1), noise=0.02))

    def sent(restart_at: int | None) -> list[Message]:
        out: list[Message] = []

        def begun(state: Any) -> Graph:
            made: Any = node(node.params_type()())
            if state is not None:
                values = msgpack.unpackb(msgpack.packb(asdict(state)), use_list=False)
                made.resume(made.State(**values))
            graph = Graph({"d": made}, {"d": {"data": "data"}}, {"d": {"odom": "odom"}})
            graph.tap("odom", out.append)
            nodes.append(made)
            return graph

        nodes: list[Any] = []
        graph = begun(None)
        for i, (w, a) in enumerate(samples):
            if i == restart_at:
                graph = begun(nodes[-1].save())
            graph.deliver("data", Imu(10_000_000 * i, w, a))
        return out

    through, resumed = sent(None)[-1], sent(400)[-1]
    assert isinstance(through, Odometry) and isinstance(resumed, Odometry)
    assert (resumed.x, resumed.y, resumed.yaw) == (through.x, through.y, through.yaw)
    assert resumed.pose_covariance == through.pose_covariance


def test_what_is_no_measurement_changes_nothing() -> None:
    reckoning = run(readings(legs()))
    before = reckoning.state
    for dt, w in ((-0.01, 0.0), (0.01, float("nan")), (0.01, 1e9)):
        with pytest.raises(ValueError, match="not a measurement"):
            reckoning.update(dt, (w, 0.0, 0.0), (0.0, 0.0, 9.8))
    assert reckoning.state == before
