"""Claims about a magnet that rides on the body: found by turning, taken out, and not seen where
there is none.
"""

from collections.abc import Callable
from math import degrees, radians, sin
from random import Random

import pytest

from lodeline.attitude import Attitude, make_attitude
from lodeline.attitude.base import GRAVITY
from lodeline.attitude.score import attitude_error
from lodeline.rotation import (
    Quaternion,
    Vector,
    conjugate,
    from_euler,
    from_rotation_vector,
    multiply,
    rotate,
)

DT = 0.01
EARTH: Vector = (0.0, 18e-6, -42e-6)
NONE: Vector = (0.0, 0.0, 0.0)
Motion = Callable[[float], Vector]

honest = pytest.mark.parametrize("method", ["soft", "mekf"])


def driving(t: float) -> Vector:
    """Body rates of a robot on the floor."""
    return (0.0, 0.0, 0.8 * sin(0.25 * t) + 0.4)


def in_the_hand(t: float) -> Vector:
    """Body rates [rad/s] that turn a sensor through all directions."""
    return (1.2 * sin(0.9 * t), 1.3 * sin(0.7 * t + 1.0), 1.1 * sin(0.5 * t + 2.0))


def resting(t: float) -> Vector:
    return NONE


class Body:
    """Sensors with the noise of an MPU-9250 whose gyro is off by 0.2 % in scale."""

    def __init__(self, method: str) -> None:
        self.estimator: Attitude = make_attitude(method, latency=0.0)
        self.truth: Quaternion = from_euler(0.0, 0.0, 0.5)
        self.rng = Random(3)

    def move(
        self, seconds: float, motion: Motion, iron: Vector = NONE, room: Vector = EARTH
    ) -> float:
        """Go on; the largest heading error [deg] of the last ten seconds."""
        worst, steps, before = 0.0, round(seconds / DT), motion(0.0)
        for i in range(steps):
            w = motion(i * DT)
            x, y, z = (0.5 * DT * (a + b) for a, b in zip(before, w, strict=True))
            before = w
            self.truth = multiply(self.truth, from_rotation_vector((x, y, z)))
            there = conjugate(self.truth)
            field = None
            if i % 2:
                clean = rotate(there, room)
                field = self._noisy(tuple(a + b for a, b in zip(clean, iron, strict=True)), 6e-7)
            gyro = self._noisy(tuple(1.002 * v for v in w), 0.002)
            force = self._noisy(rotate(there, (0.0, 0.0, GRAVITY)), 0.05)
            self.estimator.update(DT, gyro, force, field)
            if i > steps - 10.0 / DT:
                error = attitude_error(self.estimator.orientation, self.truth)
                worst = max(worst, degrees(error.heading))
        return worst

    def _noisy(self, v: tuple[float, ...], std: float) -> Vector:
        x, y, z = (value + self.rng.gauss(0.0, std) for value in v)
        return (x, y, z)

    @property
    def iron(self) -> Vector:
        found: Vector = self.estimator.state.iron
        return found


@honest
@pytest.mark.parametrize("motion", [driving, in_the_hand])
@pytest.mark.parametrize("iron", [(12e-6, -8e-6, 5e-6), (-30e-6, 20e-6, 25e-6)])
def test_a_magnet_put_on_the_body_is_found_by_turning_and_forgotten_when_taken_off(
    method: str, motion: Motion, iron: Vector
) -> None:
    """The smaller one alone would swing a compass by 45 degrees, the larger one turn it around."""
    body = Body(method)
    body.move(15.0, resting)
    assert body.move(60.0, motion, iron) < 4.0
    assert body.iron[:2] == pytest.approx(iron[:2], abs=2e-6)
    assert not body.estimator.disturbed
    assert body.move(60.0, motion) < 4.0
    assert not body.estimator.disturbed


@honest
def test_a_magnet_that_rides_along_is_remembered_while_the_robot_stands(method: str) -> None:
    iron = (12e-6, -8e-6, 5e-6)
    body = Body(method)
    body.move(15.0, resting)
    body.move(40.0, driving, iron)
    assert body.move(60.0, resting, iron) < 4.0
    assert body.iron[:2] == pytest.approx(iron[:2], abs=2e-6)


@honest
@pytest.mark.parametrize("motion", [driving, in_the_hand])
def test_a_magnet_in_the_room_is_not_taken_for_one_on_the_body(method: str, motion: Motion) -> None:
    body = Body(method)
    body.move(15.0, resting)
    beside = rotate(from_euler(0.0, 0.0, radians(25.0)), (0.0, 26e-6, -50e-6))
    body.move(15.0, motion, room=beside)
    assert body.iron == pytest.approx(NONE, abs=3e-6)


@honest
def test_a_magnet_laid_down_beside_a_standing_robot_is_nobodys(method: str) -> None:
    body = Body(method)
    body.move(15.0, resting)
    assert body.move(60.0, resting, (12e-6, -8e-6, 5e-6)) < 4.0
    assert body.iron == NONE
