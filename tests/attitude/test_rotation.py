"""Claims about the rotation helpers that everything else stands on."""

from collections.abc import Iterable
from math import inf, isnan, nan, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline import rotation as rot

angles = st.floats(-pi, pi)
vectors = st.tuples(*[st.floats(-10, 10)] * 3)


def near(a: Iterable[float], b: Iterable[float], tolerance: float = 1e-9) -> bool:
    return all(abs(x - y) <= tolerance for x, y in zip(a, b, strict=True))


@given(st.floats(-1e4, 1e4))
def test_wrapped_angle_is_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = rot.wrap_angle(angle)
    assert -pi < wrapped <= pi
    turns = (angle - wrapped) / (2 * pi)
    assert abs(turns - round(turns)) < 1e-9


def test_half_a_turn_has_one_name() -> None:
    assert rot.wrap_angle(-pi) == pi
    assert rot.wrap_angle(pi) == pi
    assert rot.wrap_angle(3 * pi) == pytest.approx(pi)
    assert rot.wrap_angle(-3 * pi) == pytest.approx(pi)
    assert isnan(rot.wrap_angle(nan))
    with pytest.raises(ValueError):
        rot.wrap_angle(inf)


def test_yaw_turns_forward_from_east_to_north() -> None:
    assert near(rot.rotate(rot.from_euler(0, 0, pi / 2), (1, 0, 0)), (0, 1, 0))


def test_positive_pitch_puts_the_nose_down() -> None:
    assert rot.rotate(rot.from_euler(0, radians(30), 0), (1, 0, 0))[2] == pytest.approx(-0.5)


def test_positive_roll_lifts_the_left_side() -> None:
    assert rot.rotate(rot.from_euler(radians(30), 0, 0), (0, 1, 0))[2] == pytest.approx(0.5)


@given(angles, st.floats(-1.56, 1.56), angles)
def test_euler_survives_quaternion_and_matrix(roll: float, pitch: float, yaw: float) -> None:
    q = rot.from_euler(roll, pitch, yaw)
    for back in (rot.to_euler(q), rot.euler_from_matrix(rot.matrix_from_euler(roll, pitch, yaw))):
        difference = (rot.wrap_angle(back[i] - a) for i, a in enumerate((roll, pitch, yaw)))
        assert near(difference, (0, 0, 0), 1e-6)
    assert rot.yaw_of(q) == pytest.approx(rot.to_euler(q)[2])


@pytest.mark.parametrize("pitch", [pi / 2, -pi / 2])
@pytest.mark.parametrize("roll", [0.0, 0.4, -2.0])
def test_vertical_nose_keeps_the_rotation_with_roll_zero(pitch: float, roll: float) -> None:
    q = rot.from_euler(roll, pitch, 0.3)
    back = rot.to_euler(q)
    assert back[0] == 0.0
    for v in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        assert near(rot.rotate(rot.from_euler(*back), v), rot.rotate(q, v), 1e-6)


@given(angles, angles, angles, vectors)
def test_matrix_and_quaternion_rotate_alike(
    roll: float, pitch: float, yaw: float, v: rot.Vector
) -> None:
    q = rot.from_euler(roll, pitch, yaw)
    assert near(rot.apply(rot.to_matrix(q), v), rot.rotate(q, v), 1e-10)
    assert near(rot.apply(rot.matrix_from_euler(roll, pitch, yaw), v), rot.rotate(q, v), 1e-10)
    assert near(rot.rotate(rot.from_matrix(rot.to_matrix(q)), v), rot.rotate(q, v), 1e-10)
    assert near(rot.rotate(rot.conjugate(q), rot.rotate(q, v)), v, 1e-10)


@given(angles, angles, angles, angles, angles, angles, vectors)
def test_products_apply_the_right_factor_first(
    a: float, b: float, c: float, d: float, e: float, f: float, v: rot.Vector
) -> None:
    p, q = rot.from_euler(a, b, c), rot.from_euler(d, e, f)
    expected = rot.rotate(p, rot.rotate(q, v))
    assert near(rot.rotate(rot.multiply(p, q), v), expected, 1e-10)
    both = rot.compose(rot.to_matrix(p), rot.to_matrix(q))
    assert near(rot.apply(both, v), expected, 1e-10)
    assert rot.determinant(both) == pytest.approx(1.0)


@given(st.tuples(*[st.floats(-1.8, 1.8)] * 3))
def test_rotation_vector_survives_the_quaternion(v: rot.Vector) -> None:
    assert near(rot.to_rotation_vector(rot.from_rotation_vector(v)), v, 1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 9.9e-5, 1.01e-4])
def test_tiny_rotations_keep_their_size_and_norm(size: float) -> None:
    q = rot.from_rotation_vector((size, 0.0, 0.0))
    assert q[0] == pytest.approx(size / 2, rel=1e-9)
    assert sum(x * x for x in q) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("bad", [(0, 0, 0, 0), (nan, 0, 0, 1), (inf, 0, 0, 1)])
def test_directionless_quaternion_is_refused(bad: rot.Quaternion) -> None:
    with pytest.raises(ValueError, match="no direction"):
        rot.normalized(bad)
