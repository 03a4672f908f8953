"""Claims about SCUTTLE's compass calibration, with the numbers of its document."""

import csv
import os
from itertools import pairwise
from math import degrees, radians
from pathlib import Path

import pytest

from lodeline.calibration.minmax import MinMax, flu_from_scuttle, theta, yaw_from_theta
from lodeline.rotation import wrap_angle

SCUTTLE = MinMax(low=(-15.0, -22.0), high=(38.0, 20.0))  # microtesla, x and y
DATA = os.environ.get("LODELINE_DATA")


def test_the_extremes_of_the_table_become_minus_one_and_one() -> None:
    assert SCUTTLE.scaled((-15.0, -22.0)) == (-1.0, -1.0)
    assert SCUTTLE.scaled((38.0, 20.0)) == (1.0, 1.0)
    assert SCUTTLE.scaled((11.5, -1.0)) == (0.0, 0.0)
    assert SCUTTLE.offset == (11.5, -1.0)


def test_the_example_heads_25_degrees_left_of_north() -> None:
    assert degrees(theta(0.42, 0.91)) == pytest.approx(25.0, abs=0.5)
    assert degrees(yaw_from_theta(theta(0.42, 0.91))) == pytest.approx(115.0, abs=0.5)


@pytest.mark.parametrize(
    ("facing", "scaled", "yaw"),
    [
        ("north", (0.0, 1.0), 90.0),
        ("west", (1.0, 0.0), 180.0),
        ("south", (0.0, -1.0), -90.0),
        ("east", (-1.0, 0.0), 0.0),
    ],
)
def test_four_directions(facing: str, scaled: tuple[float, float], yaw: float) -> None:
    heading = theta(*scaled)
    if facing == "west":
        assert heading > 0
    if facing == "east":
        assert heading < 0
    assert wrap_angle(yaw_from_theta(heading) - radians(yaw)) == pytest.approx(0.0)


def test_forward_of_scuttle_is_x_and_its_right_is_minus_y() -> None:
    assert flu_from_scuttle((0.0, 1.0, 0.0)) == (1.0, 0.0, 0.0)
    assert flu_from_scuttle((1.0, 0.0, 0.0)) == (0.0, -1.0, 0.0)
    assert flu_from_scuttle((0.0, 0.0, 1.0)) == (0.0, 0.0, 1.0)


def test_an_axis_that_never_moved_is_refused() -> None:
    with pytest.raises(ValueError, match="axis 1 never turned"):
        MinMax.of([(0.0, 5.0), (1.0, 5.0)])
    with pytest.raises(ValueError, match="0 smallest readings"):
        MinMax((), ())
    with pytest.raises(ValueError, match="axis 0 never turned"):
        MinMax((float("nan"),), (1.0,))


@pytest.mark.skipif(DATA is None, reason="LODELINE_DATA is not set")
def test_two_real_turns_become_two_turns_only_with_calibration() -> None:
    path = Path(DATA or "", "marg_rotations", "rotate_z_ccw_2turns_mag.csv")
    with path.open() as file:
        field = [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]
    found = MinMax.of(field)
    assert found.low == pytest.approx((-0.230, -0.439), abs=1e-3)
    assert found.high == pytest.approx((0.260, 0.058), abs=1e-3)

    def advance(vectors: list[tuple[float, ...]]) -> float:
        angles = [theta(x, y) for x, y in vectors]
        return degrees(sum(wrap_angle(b - a) for a, b in pairwise(angles)))

    assert advance([found.scaled(v) for v in field]) == pytest.approx(720.0, abs=8.0)  # by hand
    assert advance(list(field)) < 400.0
