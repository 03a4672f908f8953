"""Planar motions: the relative pose between two odometry poses, and parts of it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from lodeline.rotation import wrap_angle


class Delta(NamedTuple):
    """A motion seen from where it began: ahead [m], left [m], turn [rad]."""

    ahead: float
    left: float
    turn: float


@dataclass(frozen=True, slots=True)
class Pace:
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
    return Delta(c * dx + s * dy, c * dy - s * dx, wrap_angle(yaw1 - yaw0))


def part(delta: Delta, begin: float, end: float) -> Delta:
    """The motion from fraction `begin` to `end` (0 to 1) of a motion at constant twist.

    The twist is the logarithm of `delta` on SE(2), so the parts of a motion compose to it again.
    """
    turn = delta.turn
    if abs(turn) < 1e-12:
        share = end - begin
        return Delta(share * delta.ahead, share * delta.left, share * turn)
    # chord = V(turn) twist, with V = [[a, -b], [b, a]]
    a, b = math.sin(turn) / turn, _versine(turn) / turn
    norm = a * a + b * b
    v_ahead = (a * delta.ahead + b * delta.left) / norm
    v_left = (a * delta.left - b * delta.ahead) / norm
    share = turn * (end - begin)
    sine, versine = math.sin(share) / turn, _versine(share) / turn
    # the twist is the same in every body frame along the way: no rotation to `begin` is needed
    return Delta(sine * v_ahead - versine * v_left, versine * v_ahead + sine * v_left, share)


def arc(way: float, turn: float) -> Delta:
    """The motion of `way` [m] along an arc that turns by `turn` [rad]."""
    chord = way * (math.sin(0.5 * turn) / (0.5 * turn) if abs(turn) > 1e-9 else 1.0)
    return Delta(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn)


def _versine(angle: float) -> float:
    """1 - cos, exact for small angles too."""
    return 2.0 * math.sin(0.5 * angle) ** 2
