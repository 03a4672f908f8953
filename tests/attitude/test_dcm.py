"""Claims about the paper's DCM: its equations in its own axes, its misprints, its gains."""

from itertools import pairwise
from math import atan2, cos, degrees, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.attitude.base import GRAVITY
from lodeline.attitude.cosines import flu_from_frd, tilt_compensated_yaw, yaw_from_heading
from lodeline.attitude.dcm import GAINS, Dcm, DcmParams
from lodeline.attitude.score import attitude_error
from lodeline.rotation import (
    IDENTITY,
    Vector,
    apply,
    conjugate,
    determinant,
    from_euler,
    matrix_from_euler,
    rotate,
    transpose,
    wrap_angle,
    yaw_of,
)

LEVEL: Vector = (0.0, 0.0, GRAVITY)
EARTH: Vector = (0.0, 20e-6, -40e-6)
PAPER = DcmParams(gains="paper")


def heading_in_frd(m: Vector, roll: float, pitch: float) -> float:
    """Equations (20) and (21) as printed: m in forward-right-down, pitch positive nose up."""
    mag_x = m[0] * cos(pitch) + m[1] * sin(roll) * sin(pitch) + m[2] * cos(roll) * sin(pitch)
    mag_y = m[1] * cos(roll) - m[2] * sin(roll)
    return atan2(-mag_y, mag_x)


@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
def test_tilt_compensation_equals_the_printed_one_in_its_own_axes(
    roll: float, pitch: float, yaw: float
) -> None:
    rows = matrix_from_euler(roll, pitch, yaw)
    field = apply(transpose(rows), EARTH)
    printed = yaw_from_heading(heading_in_frd(flu_from_frd(field), roll, -pitch))
    assert wrap_angle(tilt_compensated_yaw(rows, field, 0.0) - printed) == pytest.approx(
        0, abs=1e-6
    )
    assert wrap_angle(printed - yaw) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("heading", "yaw"), [(0, 90), (45, 45), (90, 0), (180, -90), (270, 180)])
def test_a_heading_from_north_becomes_a_yaw_from_east(heading: float, yaw: float) -> None:
    assert degrees(yaw_from_heading(radians(heading))) == pytest.approx(yaw)


def test_down_in_frd_is_up_in_flu_the_other_way_round() -> None:
    assert flu_from_frd((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)


def test_the_published_gains_are_those_of_pololu() -> None:
    """0.02 and 0.00002 per LSB at 256 LSB/g, integrated once per step at 50 Hz."""
    paper = GAINS["paper"]
    assert paper.tilt_p == pytest.approx(0.02 * 256)
    assert paper.tilt_i == pytest.approx(0.00002 * 256 * 50)
    assert paper.yaw_p == pytest.approx(1.2)
    assert paper.yaw_i == pytest.approx(0.00002 * 50)
    assert paper.compass_period == pytest.approx(6 / 50)


@pytest.mark.parametrize("gains", ["paper", "tuned"])
def test_tilt_error_dies_out_instead_of_growing(gains: str) -> None:
    """(16) as printed, with measured gravity, would push the other way."""
    estimator = Dcm(DcmParams(gains=gains))  # type: ignore[arg-type]
    lean = from_euler(radians(20), radians(-10), 0.5)
    estimator.update(
        0.02, (0, 0, 0), rotate(conjugate(lean), LEVEL), rotate(conjugate(lean), EARTH)
    )
    level = from_euler(0.0, 0.0, 0.5)
    for _ in range(50 * 60):
        estimator.update(0.02, (0, 0, 0), LEVEL, rotate(conjugate(level), EARTH))
    assert degrees(attitude_error(estimator.orientation, level).total) < 1.5


def test_gyro_alone_turns_the_right_way_about_every_axis() -> None:
    """(9) and (19): R (I + [w dt]x), which the paper leaves out or prints as dt w."""
    for axis in range(3):
        estimator = Dcm(PAPER)
        estimator.update(0.01, (0, 0, 0), LEVEL)
        rate = tuple(radians(45) if i == axis else 0.0 for i in range(3))
        for _ in range(100):  # weightless, so that nothing corrects
            estimator.update(0.01, (rate[0], rate[1], rate[2]), (0.0, 0.0, 0.0))
        angle = [0.0, 0.0, 0.0]
        angle[axis] = radians(45)
        # the first sample still carries a correction of zero; the first order costs 0.05 deg here
        assert degrees(attitude_error(estimator.orientation, from_euler(*angle)).total) < 0.1


def test_the_matrix_stays_a_rotation_over_a_hundred_thousand_steps() -> None:
    estimator = Dcm(PAPER)
    for i in range(100_000):
        estimator.update(0.005, (sin(i), cos(0.7 * i), 2.0), (0.0, 0.0, 0.0))
    rows = estimator.state.rows
    assert rows is not None
    assert determinant(rows) == pytest.approx(1.0, abs=1e-3)
    for a in range(3):
        for b in range(3):
            dot = sum(x * y for x, y in zip(rows[a], rows[b], strict=True))
            assert dot == pytest.approx(float(a == b), abs=1e-3)


def test_axes_stay_square_while_turning_about_a_slanting_axis() -> None:
    """(10) and (11): without them first and second row lean together, a little at every step."""
    estimator = Dcm(PAPER)
    for _ in range(2000):
        estimator.update(0.01, (2.0, 2.0, 0.5), (0.0, 0.0, 0.0))
    rows = estimator.state.rows
    assert rows is not None
    assert sum(x * y for x, y in zip(rows[0], rows[1], strict=True)) == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("gains", ["paper", "tuned"])
def test_integral_part_never_winds_up_beyond_what_a_gyro_can_be_off(gains: str) -> None:
    estimator = Dcm(DcmParams(gains=gains))  # type: ignore[arg-type]
    estimator.update(0.02, (0, 0, 0), LEVEL, EARTH)
    for _ in range(50 * 120):  # lying on its side while the gyro claims a steady spin
        estimator.update(0.02, (8.0, 0.0, 0.0), (0.0, GRAVITY, 0.0))
    assert sum(b * b for b in estimator.gyro_bias) <= 1.0 + 1e-9


@pytest.mark.parametrize("gains", ["paper", "tuned"])
def test_integral_part_finds_a_gyro_bias(gains: str) -> None:
    estimator = Dcm(DcmParams(gains=gains))  # type: ignore[arg-type]
    bias = (radians(1.0), radians(-0.5), radians(0.8))
    for _ in range(50 * 1500):
        estimator.update(0.02, bias, LEVEL, EARTH)
    found = estimator.gyro_bias
    assert [degrees(b) for b in found[:2]] == pytest.approx([1.0, -0.5], abs=0.05)
    assert abs(degrees(wrap_angle(yaw_of(estimator.orientation)))) < 5.0


def test_a_compass_heading_is_held_for_six_steps_at_fifty_hertz() -> None:
    estimator = Dcm(PAPER)
    changes = []
    held = None
    for i in range(60):
        yaw = 0.001 * i
        field = rotate(conjugate(from_euler(0.0, 0.0, yaw)), EARTH)
        estimator.update(0.02, (0.0, 0.0, 0.05), LEVEL, field)
        if estimator.state.compass != held:
            held = estimator.state.compass
            changes.append(i)
    assert {b - a for a, b in pairwise(changes)} <= {6, 7}


@pytest.mark.parametrize("push", [0.0, 3.0])
def test_nothing_corrects_in_free_fall_or_at_three_g(push: float) -> None:
    """The paper's weight of the accelerometer: 1 - 2 |1 - |a| / g|, never below zero."""
    estimator = Dcm(PAPER)
    estimator.update(0.02, (0, 0, 0), LEVEL)
    for _ in range(50):
        estimator.update(0.02, (0, 0, 0), (push * GRAVITY, 0.0, 0.0))
    assert degrees(attitude_error(estimator.orientation, IDENTITY).total) < 1e-6
    estimator.update(0.02, (0, 0, 0), (GRAVITY, 0.0, 0.0))
    estimator.update(0.02, (0, 0, 0), (GRAVITY, 0.0, 0.0))
    assert degrees(attitude_error(estimator.orientation, IDENTITY).total) > 1.0
