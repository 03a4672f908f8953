"""Planar motions: the relative pose between two odometry poses, and parts of it."""

import math
from typing import NamedTuple

from lodeline.ekf.belief import made
from lodeline.rotation import wrap_angle

STRAIGHT = 1e-12  # rad: a smaller turn bends nothing


class Delta(NamedTuple):
    """A motion seen from where it began: ahead [m], left [m], turn [rad]."""

    ahead: float
    left: float
    turn: float


class Pace(NamedTuple):
    """How fast the robot went last [m/s, rad/s].

    `unmeasured`: it is in the midst of a way that nobody measures.
    """

    v: float = 0.0
    w: float = 0.0
    unmeasured: bool = False


def relative(x0: float, y0: float, yaw0: float, x1: float, y1: float, yaw1: float) -> Delta:
    """The motion from pose 0 to pose 1 [m, m, rad], in the body frame of pose 0."""
    c, s = math.cos(yaw0), math.sin(yaw0)
    dx, dy = x1 - x0, y1 - y0
    return made(Delta, (c * dx + s * dy, c * dy - s * dx, wrap_angle(yaw1 - yaw0)))


def twist(delta: Delta) -> Delta:
    """The logarithm of a motion on SE(2): what it is per whole of it, in the body frame."""
    ahead, left, turn = delta
    if abs(turn) < STRAIGHT:
        return delta
    # chord = V(turn) twist, with V = [[a, -b], [b, a]]
    a, b = math.sin(turn) / turn, _versine(turn) / turn
    norm = a * a + b * b
    return made(Delta, ((a * ahead + b * left) / norm, (a * left - b * ahead) / norm, turn))


def part(twist: Delta, share: float) -> Delta:
    """A `share` (0 to 1) of a motion at constant `twist`; such parts compose to the whole again.

    The twist is the same in every body frame along the way, so it matters not where they begin.
    """
    ahead, left, turn = twist
    if -STRAIGHT < turn < STRAIGHT:
        return Delta(share * ahead, share * left, share * turn)
    angle = turn * share
    sine, half = math.sin(angle) / turn, math.sin(0.5 * angle)
    versine = 2.0 * half * half / turn
    return made(Delta, (sine * ahead - versine * left, versine * ahead + sine * left, angle))


def arc(way: float, turn: float) -> Delta:
    """The motion of `way` [m] along an arc that turns by `turn` [rad]."""
    chord = way * (math.sin(0.5 * turn) / (0.5 * turn) if abs(turn) > 1e-9 else 1.0)
    return Delta(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn)


def _versine(angle: float) -> float:
    """1 - cos, exact for small angles too."""
    return 2.0 * math.sin(0.5 * angle) ** 2
