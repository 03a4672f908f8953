"""Claims about what a person who calibrates is shown: turns, sides, and the circle."""

from __future__ import annotations

from math import cos, degrees, radians, sin
from random import Random

import pytest

from lodeline.calibration import ImuCalibration
from lodeline.calibration.compass import SECTORS, fit_ellipse
from lodeline.calibration.coverage import SIDES, picture, sides, turned
from lodeline.calibration.wheels import stopped
from lodeline.rotation import Vector

IRON = (30.0, -18.0)  # uT, more than the field itself


def seen(start: float, end: float, noise: float = 0.3) -> list[Vector]:
    """Field [uT] while the robot turns from one heading [deg] to another, at 2 deg a reading."""
    rng = Random(5)
    steps = int(abs(end - start) / 2)
    yaws = [radians(start + (end - start) * i / steps) for i in range(steps + 1)]
    return [
        (
            22.0 * sin(yaw) + IRON[0] + rng.gauss(0.0, noise),
            20.0 * cos(yaw) + IRON[1] + rng.gauss(0.0, noise),
            -40.0,
        )
        for yaw in yaws
    ]


@pytest.mark.parametrize(("start", "end"), [(0, 90), (30, 390), (0, 720), (200, -400)])
def test_turns_are_counted_to_a_tenth_whichever_way_and_wherever_it_starts(
    start: float, end: float
) -> None:
    found = turned(seen(start, end))
    assert found.turns == pytest.approx(abs(end - start) / 360.0, abs=0.1)
    assert len(found.passes) == SECTORS
    assert sum(found.passes) == pytest.approx(abs(end - start) / 360.0 * SECTORS, abs=3)


def test_going_back_does_not_count_twice() -> None:
    there, back = seen(0, 300), seen(300, 0)
    assert turned(there + back + there).turns == pytest.approx(turned(there).turns, abs=0.03)


def test_a_spike_is_no_turn() -> None:
    fields = seen(0, 350)
    fields[80] = (400.0, -300.0, 0.0)
    assert turned(fields).turns == pytest.approx(350.0 / 360.0, abs=0.05)


def test_sides_are_those_that_it_lay_on() -> None:
    lain = sides([(0.1, 0.2, 9.7), (-9.9, 0.4, 0.0)])
    assert [name for name, done in zip(SIDES, lain, strict=True) if done] == ["x down", "z up"]


def test_the_picture_tells_the_error_before_and_after() -> None:
    """An offset of e.g. 4 uT in a field of 21 turns the heading by up to asin(4/21)."""
    fields = [(x * 1e-6, y * 1e-6, z * 1e-6) for x, y, z in seen(0, 720)]
    near = ImuCalibration(mag_offset=((IRON[0] - 4.0) * 1e-6, IRON[1] * 1e-6, 0.0))
    drawn = picture(fields, near, fit_ellipse(fields))
    assert degrees(drawn.was) == pytest.approx(degrees(4.0 / 21.0) / 2**0.5, abs=1.5)
    assert degrees(drawn.left) < 1.0
    assert drawn.centre[0] * 1e6 == pytest.approx(4.0, abs=0.3)
    assert abs(drawn.centre[1] * 1e6) < 0.3
    for x, y in drawn.after:
        assert (x * x + y * y) ** 0.5 == pytest.approx(drawn.radius, rel=0.08)
    assert "4.0 uT off its centre" in drawn.words


def test_wheels_have_stopped_when_they_have_for_a_second_and_a_half() -> None:
    times = [0.1 * i for i in range(60)]
    rolled = [(min(i, 40) * 50, min(i, 40) * 50 + i % 2) for i in range(60)]
    assert stopped(times, rolled, 360.0)
    assert not stopped(times[:50], rolled[:50], 360.0)
