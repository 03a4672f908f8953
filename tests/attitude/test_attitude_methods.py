"""Claims that every attitude method keeps, whatever it does inside."""

import json
from dataclasses import asdict, fields
from math import cos, degrees, inf, nan, radians, sin
from random import Random
from typing import Any

import pytest

from lodeline.attitude import METHODS, Attitude, make_attitude
from lodeline.attitude.base import GRAVITY
from lodeline.attitude.doubt import UNKNOWN_HEADING
from lodeline.attitude.score import attitude_error
from lodeline.rotation import (
    Quaternion,
    Vector,
    conjugate,
    from_euler,
    from_rotation_vector,
    multiply,
    rotate,
    wrap_angle,
    yaw_of,
)

DT = 0.01
LEVEL: Vector = (0.0, 0.0, GRAVITY)
EARTH: Vector = (0.0, 20e-6, -40e-6)  # field in ENU at dip 63 deg, declination 0

every = pytest.mark.parametrize("method", sorted(METHODS))
tilting = pytest.mark.parametrize("method", sorted(set(METHODS) - {"compass"}))


def sense(q: Quaternion) -> tuple[Vector, Vector]:
    """Specific force and field that a resting body with orientation q would measure."""
    return rotate(conjugate(q), LEVEL), rotate(conjugate(q), EARTH)


def feed_still(
    estimator: Attitude, q: Quaternion, seconds: float, gyro: Vector = (0, 0, 0)
) -> None:
    force, field = sense(q)
    for _ in range(round(seconds / DT)):
        estimator.update(DT, gyro, force, field)


def noisy(rng: Random, v: Vector, std: float) -> Vector:
    return (v[0] + rng.gauss(0.0, std), v[1] + rng.gauss(0.0, std), v[2] + rng.gauss(0.0, std))


def walk(seconds: float, seed: int) -> list[tuple[float, Vector, Vector, Vector | None]]:
    """A noisy wandering body; the field comes with every second sample."""
    rng = Random(seed)
    q = from_euler(0.1, -0.2, 1.0)
    samples: list[tuple[float, Vector, Vector, Vector | None]] = []
    for i in range(round(seconds / DT)):
        t = i * DT
        w = (0.3 * sin(0.7 * t), 0.2 * cos(0.9 * t), 0.5 * sin(0.3 * t))
        q = multiply(q, from_rotation_vector((w[0] * DT, w[1] * DT, w[2] * DT)))
        force, field = sense(q)
        compass = noisy(rng, field, 3e-7) if i % 2 else None
        samples.append((DT, noisy(rng, w, 0.01), noisy(rng, force, 0.05), compass))
    return samples


@tilting
@pytest.mark.parametrize("pose", [(0, 0, 0), (20, -30, 75), (-10, 45, -170), (5, 5, 180)])
def test_starts_from_gravity_and_north_at_once(method: str, pose: tuple[float, ...]) -> None:
    q = from_euler(*map(radians, pose))
    estimator = make_attitude(method)
    assert estimator.heading_std == pytest.approx(UNKNOWN_HEADING)
    estimator.update(DT, (0, 0, 0), *sense(q))
    assert degrees(attitude_error(estimator.orientation, q).total) < 0.1
    assert estimator.heading_std < radians(10)


@every
def test_first_field_may_come_late(method: str) -> None:
    q = from_euler(0.0, 0.0, 2.0)
    estimator = make_attitude(method)
    force, field = sense(q)
    for _ in range(50):
        estimator.update(DT, (0, 0, 0), force, None)
    assert estimator.heading_std > radians(90)
    estimator.update(DT, (0, 0, 0), force, field)
    assert degrees(attitude_error(estimator.orientation, q).total) < 0.1


@every
@pytest.mark.parametrize("declination", [-30.0, 0.0, 12.5])
def test_declination_east_turns_true_yaw_clockwise_once(method: str, declination: float) -> None:
    q = from_euler(0.0, 0.0, 0.5)
    estimator = make_attitude(method, declination=radians(declination))
    feed_still(estimator, q, 5.0)
    assert degrees(yaw_of(estimator.orientation)) == pytest.approx(
        degrees(0.5) - declination, abs=0.2
    )


@every
@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e200])
@pytest.mark.parametrize("place", range(10))
def test_a_number_that_is_none_is_refused_and_leaves_no_trace(
    method: str, bad: float, place: int
) -> None:
    estimator = make_attitude(method)
    feed_still(estimator, from_euler(0.1, 0.2, 0.3), 0.1)
    before = estimator.state
    numbers = [DT, 0.0, 0.0, 0.0, *LEVEL, *EARTH]
    numbers[place] = bad
    dt, gx, gy, gz, ax, ay, az, mx, my, mz = numbers
    with pytest.raises(ValueError, match="not a measurement"):
        estimator.update(dt, (gx, gy, gz), (ax, ay, az), (mx, my, mz))
    assert estimator.state == before


@every
def test_time_going_backwards_is_refused(method: str) -> None:
    estimator = make_attitude(method)
    estimator.update(DT, (0, 0, 0), LEVEL, EARTH)
    before = estimator.state
    with pytest.raises(ValueError, match="not a measurement"):
        estimator.update(-DT, (0, 0, 0), LEVEL, EARTH)
    assert estimator.state == before


@every
def test_handing_over_half_way_changes_nothing(method: str) -> None:
    samples = walk(40.0, seed=3)
    whole, first, second = make_attitude(method), make_attitude(method), make_attitude(method)
    for sample in samples:
        whole.update(*sample)
    for sample in samples[:2000]:
        first.update(*sample)
    handed = first.state
    for sample in samples[2000:]:
        first.update(*sample)  # going on must not disturb what was handed over
    as_text = json.loads(json.dumps(asdict(handed)))  # flat: survives a file
    second.resume(METHODS[method].State(**_tuples(as_text)))
    for sample in samples[2000:]:
        second.update(*sample)
    assert second.state == whole.state == first.state
    assert second.orientation == whole.orientation


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    def deep(value: Any) -> Any:
        return tuple(map(deep, value)) if isinstance(value, list) else value

    return {name: deep(value) for name, value in values.items()}


@every
def test_wild_input_never_leaves_a_non_finite_or_unnormalised_answer(method: str) -> None:
    rng = Random(8)
    estimator = make_attitude(method)
    sizes = (0.0, 1e-9, 1.0, 30.0, 1e5)
    for _ in range(3000):
        gyro, force, field = (noisy(rng, (0, 0, 0), rng.choice(sizes)) for _ in range(3))
        dt = rng.choice((0.0, 1e-6, 0.01, 0.5, 20.0))
        estimator.update(dt, gyro, force, field if rng.random() < 0.5 else None)
        assert sum(x * x for x in estimator.orientation) == pytest.approx(1.0, abs=1e-5)
        assert 0.0 <= estimator.heading_std <= UNKNOWN_HEADING + 1e-12
        assert all(abs(b) < 1e3 for b in estimator.gyro_bias)
    # and it finds back to the truth
    q = from_euler(0.0, 0.0, -1.0)
    estimator.resume(METHODS[method].State())
    feed_still(estimator, q, 1.0)
    assert degrees(attitude_error(estimator.orientation, q).total) < 0.1


@every
def test_a_quarter_turn_left_adds_ninety_degrees(method: str) -> None:
    estimator = make_attitude(method)
    feed_still(estimator, from_euler(0.0, 0.0, 0.3), 3.0)
    rate = radians(90.0)
    for i in range(1, 101):
        estimator.update(DT, (0.0, 0.0, rate), *sense(from_euler(0.0, 0.0, 0.3 + rate * i * DT)))
    turned = wrap_angle(yaw_of(estimator.orientation) - 0.3)
    assert degrees(turned) == pytest.approx(90.0, abs=2.0)


@every
@pytest.mark.parametrize("hole", [0.3, 1.3, 10.0])
@pytest.mark.parametrize("rate", [0.0, 1.0, -1.0])
def test_after_a_hole_in_the_samples_three_sigma_hold_the_error(
    method: str, hole: float, rate: float
) -> None:
    """The body turns in the hole and only there: before and after it the gyro sees nothing."""
    estimator = make_attitude(method)
    feed_still(estimator, from_euler(0.0, 0.0, 0.5), 10.0)
    truth = from_euler(0.0, 0.0, 0.5 + rate * hole)
    estimator.update(hole, (0, 0, 0), *sense(truth))
    for _ in range(2000):
        error = attitude_error(estimator.orientation, truth)
        assert error.heading <= 3.0 * estimator.heading_std
        estimator.update(DT, (0, 0, 0), *sense(truth))
    if method not in ("gyro", "complementary", "dcm"):
        assert degrees(attitude_error(estimator.orientation, truth).total) < 6.0


@every
def test_a_heading_outlives_a_hole_after_which_no_field_is_seen(method: str) -> None:
    truth = from_euler(0.0, 0.0, 0.5)
    estimator = make_attitude(method)
    feed_still(estimator, truth, 10.0)
    force, _ = sense(truth)
    for dt in (0.3, *[DT] * 200):
        estimator.update(dt, (0, 0, 0), force, None)
        error = attitude_error(estimator.orientation, truth)
        assert degrees(error.total) < 1.0
        assert error.heading <= 3.0 * estimator.heading_std


@every
def test_states_are_flat(method: str) -> None:
    def flat(value: object) -> bool:
        if isinstance(value, tuple):
            return all(map(flat, value))
        return value is None or isinstance(value, float | int | bool | str)

    estimator = make_attitude(method)
    for sample in walk(1.0, seed=1):
        estimator.update(*sample)
    state = estimator.state
    assert all(flat(getattr(state, item.name)) for item in fields(state))
    assert not hasattr(state, "__dict__")


def test_wrong_names_are_answered_with_the_nearest_right_one() -> None:
    with pytest.raises(ValueError, match="did you mean 'soft'"):
        make_attitude("sotf")
    with pytest.raises(ValueError, match="did you mean 'declination'"):
        make_attitude("soft", declinaton=0.1)
    with pytest.raises(ValueError, match="one of paper, tuned"):
        make_attitude("dcm", gains="best")
