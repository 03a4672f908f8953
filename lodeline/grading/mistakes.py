"""Mistakes that people make in the exercises, so that they can be told which one it was.

Each is the function as it is then written, and a hint that leaves the thinking to them.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan, atan2, cos, degrees, pi, sin
from typing import Any

Pair = tuple[float, float]
Row = tuple[float, float, float]
Wrong = tuple[Callable[..., Any], str]

NOTHING = "this is the blank as it was: your part is still to be written"


def _euler(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), (right - left) / track
    return way * cos(yaw), way * sin(yaw), turn


def _end_heading(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), (right - left) / track
    return way * cos(yaw + turn), way * sin(yaw + turn), turn


def _half_track(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), 2.0 * (right - left) / track
    return way * cos(yaw + 0.5 * turn), way * sin(yaw + 0.5 * turn), turn


def _clockwise(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), (left - right) / track
    return way * cos(yaw + 0.5 * turn), way * sin(yaw + 0.5 * turn), turn


def _from_north(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), (right - left) / track
    return way * sin(yaw + 0.5 * turn), way * cos(yaw + 0.5 * turn), turn


def _both_wheels(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = left + right, (right - left) / track
    return way * cos(yaw + 0.5 * turn), way * sin(yaw + 0.5 * turn), turn


def _twice_track(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), 0.5 * (right - left) / track
    return way * cos(yaw + 0.5 * turn), way * sin(yaw + 0.5 * turn), turn


def _new_heading(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), (right - left) / track
    return way * cos(yaw + 0.5 * turn), way * sin(yaw + 0.5 * turn), yaw + turn


def _turn_in_degrees(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), degrees((right - left) / track)
    return way * cos(yaw + 0.5 * turn), way * sin(yaw + 0.5 * turn), turn


def _arc(left: float, right: float, track: float, yaw: float) -> Row:
    way, turn = 0.5 * (left + right), (right - left) / track
    chord = way * sin(0.5 * turn) / (0.5 * turn) if turn else way
    return chord * cos(yaw + 0.5 * turn), chord * sin(yaw + 0.5 * turn), turn


def _no_travel(_left: float, _right: float, _track: float, _yaw: float) -> Row:
    return 0.0, 0.0, 0.0


TRAVEL: tuple[Wrong, ...] = (
    (_euler, "this is Euler's sum: it takes the heading from before the step"),
    (_end_heading, "this takes the heading from after the step"),
    (_half_track, "the robot turns twice as far as it should: is track the whole distance?"),
    (
        _twice_track,
        "the robot turns half as far as it should: when one wheel stands, how far is it?",
    ),
    (_both_wheels, "the robot goes twice as far as it should: its middle is between the wheels"),
    (_clockwise, "left and right are exchanged: which wheel goes further in a left turn?"),
    (_from_north, "sine and cosine are exchanged: yaw 0 is east, not north"),
    (_new_heading, "the third number is the turn of this step, not the heading after it"),
    (_turn_in_degrees, "angles are radians everywhere"),
    (_arc, "this is the exact arc, and right; what is asked for here is its chord as if straight"),
    (_no_travel, NOTHING),
)


def _uncalibrated(x: float, y: float, _low: Pair, _high: Pair) -> float:
    return 0.5 * pi - atan2(y, x)


def _unscaled(x: float, y: float, low: Pair, high: Pair) -> float:
    return 0.5 * pi - atan2(y - 0.5 * (high[1] + low[1]), x - 0.5 * (high[0] + low[0]))


def _scaled(x: float, y: float, low: Pair, high: Pair) -> Pair:
    return (
        (2.0 * x - high[0] - low[0]) / (high[0] - low[0]),
        (2.0 * y - high[1] - low[1]) / (high[1] - low[1]),
    )


def _turned_over(x: float, y: float, low: Pair, high: Pair) -> float:
    a, b = _scaled(x, y, low, high)
    return atan2(b, a)


def _off_by_a_quarter(x: float, y: float, low: Pair, high: Pair) -> float:
    a, b = _scaled(x, y, low, high)
    return -atan2(b, a)


def _clockwise_heading(x: float, y: float, low: Pair, high: Pair) -> float:
    a, b = _scaled(x, y, low, high)
    return 0.5 * pi + atan2(b, a)


def _half_the_circle(x: float, y: float, low: Pair, high: Pair) -> float:
    a, b = _scaled(x, y, low, high)
    return 0.5 * pi - atan(b / a)


def _heading_in_degrees(x: float, y: float, low: Pair, high: Pair) -> float:
    a, b = _scaled(x, y, low, high)
    return 90.0 - degrees(atan2(b, a))


def _no_heading(_x: float, _y: float, _low: Pair, _high: Pair) -> float:
    return 0.0


HEADING: tuple[Wrong, ...] = (
    (_uncalibrated, "low and high are not used: the iron on the robot is still in it"),
    (_unscaled, "the middle is right, but both axes must reach equally far"),
    (_turned_over, "this is where north is, seen from the robot: where is the robot then?"),
    (_off_by_a_quarter, "this counts from north: where is yaw 0?"),
    (_clockwise_heading, "when the robot turns left, the field turns right: mind the sign"),
    (_half_the_circle, "atan knows half of the circle only: which function knows all of it?"),
    (_heading_in_degrees, "angles are radians everywhere"),
    (_no_heading, NOTHING),
)


def _in_the_map(x: float, y: float, _yaw: float, magnet: Pair) -> Pair:
    return magnet[0] - x, magnet[1] - y


def _turned_back(x: float, y: float, yaw: float, magnet: Pair) -> Pair:
    east, north = magnet[0] - x, magnet[1] - y
    return cos(yaw) * east - sin(yaw) * north, sin(yaw) * east + cos(yaw) * north


def _from_the_magnet(x: float, y: float, yaw: float, magnet: Pair) -> Pair:
    east, north = x - magnet[0], y - magnet[1]
    return cos(yaw) * east + sin(yaw) * north, cos(yaw) * north - sin(yaw) * east


def _to_the_right(x: float, y: float, yaw: float, magnet: Pair) -> Pair:
    east, north = magnet[0] - x, magnet[1] - y
    return cos(yaw) * east + sin(yaw) * north, sin(yaw) * east - cos(yaw) * north


def _nowhere(_x: float, _y: float, _yaw: float, _magnet: Pair) -> Pair:
    return 0.0, 0.0


EXPECTED: tuple[Wrong, ...] = (
    (_in_the_map, "expected: the difference is still in the map's axes, not in the robot's"),
    (_turned_back, "expected: turned the wrong way round, by yaw and not by -yaw"),
    (_from_the_magnet, "expected: this is the robot seen from the magnet"),
    (_to_the_right, "expected: the second number counts to the left, this one to the right"),
    (_nowhere, "expected: still to be written"),
)


def _no_turn(_x: float, _y: float, yaw: float, _magnet: Pair) -> tuple[Row, Row]:
    return (-cos(yaw), -sin(yaw), 0.0), (sin(yaw), -cos(yaw), 0.0)


def _positive(x: float, y: float, yaw: float, magnet: Pair) -> tuple[Row, Row]:
    (a, b, c), (d, e, f) = right_jacobian(x, y, yaw, magnet)
    return (-a, -b, c), (-d, -e, f)


def _turn_negated(x: float, y: float, yaw: float, magnet: Pair) -> tuple[Row, Row]:
    (a, b, c), (d, e, f) = right_jacobian(x, y, yaw, magnet)
    return (a, b, -c), (d, e, -f)


def _transposed(x: float, y: float, yaw: float, magnet: Pair) -> tuple[Row, Row]:
    (a, b, c), (d, e, f) = right_jacobian(x, y, yaw, magnet)
    return (a, -b, c), (-d, e, f)


def _no_rows(_x: float, _y: float, _yaw: float, _magnet: Pair) -> tuple[Row, Row]:
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def right_jacobian(x: float, y: float, yaw: float, magnet: Pair) -> tuple[Row, Row]:
    """`jacobian` as it should be, whatever `expected` says."""
    east, north = magnet[0] - x, magnet[1] - y
    forward, left = cos(yaw) * east + sin(yaw) * north, cos(yaw) * north - sin(yaw) * east
    return (-cos(yaw), -sin(yaw), left), (sin(yaw), -cos(yaw), -forward)


JACOBIAN: tuple[Wrong, ...] = (
    (_no_turn, "jacobian: a turn moves the magnet in the robot's view too (third column)"),
    (_positive, "jacobian: when the robot goes forward, the magnet comes nearer (x and y)"),
    (_turn_negated, "jacobian: the third column has the wrong sign"),
    (_transposed, "jacobian: the sines of the first two columns have the wrong sign"),
    (_no_rows, "jacobian: still to be written"),
)
