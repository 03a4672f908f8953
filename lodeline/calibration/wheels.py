"""Calibration of wheels from a drive that was measured: a straight line, turns on one spot.

The line gives the radius of the wheels, the turns give the track. Counts are those of the encoders
from beginning to end, of either sign; which way a counter runs is told, not needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

from lodeline.calibration.quality import CalibrationRefusedError

FEWEST_TURNS = 3.0  # of a wheel; less drowns in play and in the eye that measured
LARGEST_DIFFERENCE = 0.05  # of the counts of one wheel from the other
STANDSTILL = 1.5  # [s], after which a drive is over
REST = 0.3  # [s], before which none begins
TREMBLE = 0.01  # of a turn, by which a wheel that stands may move


@dataclass(frozen=True, slots=True)
class WheelFit:
    """One length [m] of the drive, and how far the wheels differed (relative)."""

    length: float
    difference: float
    left_sign: int
    right_sign: int


def fit_radius(left: int, right: int, ticks_per_turn: float, distance: float) -> WheelFit:
    """Radius of the wheels from the counts over a straight line `distance` [m] long, driven
    forwards. `ticks_per_turn` are counts while the wheel turns once, gear and all.

    CalibrationRefusedError when a wheel hardly turned or the way was no straight line.
    """
    if not distance > 0.0:
        raise CalibrationRefusedError(f"a line of {distance:g} m is none")
    turns, difference = _turns(left, right, ticks_per_turn, "was no straight line")
    return WheelFit(distance / (2.0 * pi * turns), difference, _sign(left), _sign(right))


def fit_track(
    left: int, right: int, ticks_per_turn: float, turns: float, wheel_radius: float
) -> WheelFit:
    """Distance of the wheels from the counts over `turns` whole turns on one spot,
    counter-clockwise.

    CalibrationRefusedError when a wheel hardly turned or the robot travelled meanwhile.
    """
    if not (turns > 0.0 and wheel_radius > 0.0):
        raise CalibrationRefusedError("turns and wheel radius must be above zero")
    rolled, difference = _turns(left, right, ticks_per_turn, "was no turn on one spot")
    return WheelFit(2.0 * wheel_radius * rolled / turns, difference, -_sign(left), _sign(right))


def stopped(
    times: Sequence[float],
    counts: Sequence[tuple[int, int]],
    per_turn: float,
    seconds: float = STANDSTILL,
) -> bool:
    """Whether the wheels have stood still for the last `seconds` of `times` [s].

    `counts` (left, right) has one pair for each time, `per_turn` of them are a turn.
    """
    late = [pair for time, pair in zip(times, counts, strict=True) if time > times[-1] - seconds]
    ranges = [max(side) - min(side) for side in zip(*late, strict=True)]
    return times[-1] - times[0] > seconds and max(ranges) <= TREMBLE * per_turn


def _turns(left: int, right: int, ticks_per_turn: float, fault: str) -> tuple[float, float]:
    """Mean turns of the wheels, and their relative difference."""
    if not ticks_per_turn > 0.0:
        raise CalibrationRefusedError(f"{ticks_per_turn:g} counts a turn make no encoder")
    mean = 0.5 * (abs(left) + abs(right)) / ticks_per_turn
    if mean < FEWEST_TURNS:
        raise CalibrationRefusedError(
            f"the wheels turned {mean:.1f} times, {FEWEST_TURNS:.0f} are needed: drive further"
        )
    difference = abs(abs(left) - abs(right)) / (mean * ticks_per_turn)
    if difference > LARGEST_DIFFERENCE:
        raise CalibrationRefusedError(
            f"the wheels differ by {100.0 * difference:.0f} %: that {fault}, or a wheel slipped"
        )
    return mean, difference


def _sign(count: int) -> int:
    return 1 if count >= 0 else -1
