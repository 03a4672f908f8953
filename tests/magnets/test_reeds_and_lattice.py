"""Claims about the reed bar and the magnet lattice, with the lab's own examples."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.magnets import Lattice, ReedBar, ReedBarParams

BAR = ReedBar(ReedBarParams())


def reeds(*numbers: int) -> int:
    return sum(1 << (number - 1) for number in numbers)


@pytest.mark.parametrize(
    ("closed", "laterals"),
    [
        (reeds(), ()),
        (reeds(3), (-0.015,)),
        (reeds(5, 6), (0.010,)),  # the lab: one measurement, +1 pitch
        (reeds(1, 7, 8), (-0.035, 0.030)),  # the lab: two, -3.5 and +3 pitches
        (reeds(1, 8), (-0.035, 0.035)),
        (reeds(1, 2, 3, 4, 5, 6, 7, 8), (0.0,)),
        (reeds(2, 4, 6), (-0.025, -0.005, 0.015)),
    ],
)
def test_a_group_of_closed_reeds_is_a_magnet_under_its_middle(
    closed: int, laterals: tuple[float, ...]
) -> None:
    assert BAR.laterals(closed) == pytest.approx(laterals, abs=1e-15)


@given(st.integers(0, 255))
def test_the_mirrored_bar_sees_mirrored_offsets(closed: int) -> None:
    mirrored = int(f"{closed:08b}"[::-1], 2)
    assert BAR.laterals(mirrored) == pytest.approx(
        [-lateral for lateral in reversed(BAR.laterals(closed))], abs=1e-15
    )


@given(st.integers(0, 255))
def test_bits_beyond_the_last_reed_are_not_looked_at(closed: int) -> None:
    assert BAR.laterals(closed | 0xFF00) == BAR.laterals(closed)
    assert BAR.laterals(closed - 256) == BAR.laterals(closed)


def test_a_bar_of_another_length_is_centred_too() -> None:
    bar = ReedBar(ReedBarParams(reeds=5, pitch=0.02))
    assert bar.laterals(0b00100) == (0.0,)
    assert bar.laterals(0b10000) == (0.04,)


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_no_magnet_is_nearer_than_the_nearest(x: float, y: float) -> None:
    lattice = Lattice(0.055, 0.01, -0.02)
    near_x, near_y = lattice.nearest(x, y)
    assert abs(x - near_x) <= 0.0275 + 1e-12
    assert abs(y - near_y) <= 0.0275 + 1e-12
    assert (near_x - 0.01) / 0.055 == pytest.approx(round((near_x - 0.01) / 0.055), abs=1e-9)
    assert (near_y + 0.02) / 0.055 == pytest.approx(round((near_y + 0.02) / 0.055), abs=1e-9)


def test_impossible_bars_and_lattices_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 reed"):
        ReedBarParams(reeds=0)
    with pytest.raises(ValueError, match="pitch of the reeds"):
        ReedBarParams(pitch=0.0)
    with pytest.raises(ValueError, match="pitch of the magnets"):
        Lattice(float("nan"))
