"""The course that the simulated robot repeats: a figure of two stadiums, one to each side.

Straight on, half a turn left, straight back, half a turn left; then the same to the right. Both
stadiums begin and end in the origin, heading along +x.
"""

from __future__ import annotations

from math import cos, hypot, pi, sin


class Course:
    """Poses along the course by arc length."""

    def __init__(self, straight: float, radius: float) -> None:
        """Lay the course out: length of a straight and radius of a turn [m]."""
        if straight < 0.0 or radius <= 0.0:
            raise ValueError("a course needs straight >= 0 and radius > 0")
        turn = pi * radius
        self._pieces: list[tuple[float, float, float, float, float, float]] = []
        s = x = y = yaw = 0.0
        for length, curvature in (
            (straight, 0.0),
            (turn, 1.0 / radius),
            (straight, 0.0),
            (turn, 1.0 / radius),
            (straight, 0.0),
            (turn, -1.0 / radius),
            (straight, 0.0),
            (turn, -1.0 / radius),
        ):
            self._pieces.append((s, curvature, x, y, yaw, length))
            x, y, yaw = _along(x, y, yaw, curvature, length)
            s += length
        self.length = s

    def at(self, s: float) -> tuple[float, float, float, float]:
        """Return (x [m], y [m], yaw [rad], curvature [1/m]) at arc length `s` [m], taken round."""
        s %= self.length
        for start, curvature, x, y, yaw, length in self._pieces:
            if s <= start + length:
                return (*_along(x, y, yaw, curvature, s - start), curvature)
        return self.at(0.0)

    def nearest(self, x: float, y: float) -> float:
        """Return the arc length [m] of the point of the course nearest to (x, y), to a cm."""
        steps = int(self.length / 0.01)
        points = (self.at(0.01 * i) for i in range(steps))
        distances = [hypot(px - x, py - y) for px, py, _, _ in points]
        return 0.01 * distances.index(min(distances))


def _along(
    x: float, y: float, yaw: float, curvature: float, length: float
) -> tuple[float, float, float]:
    """Return the pose after `length` [m] of constant curvature [1/m]."""
    if curvature == 0.0:
        return x + length * cos(yaw), y + length * sin(yaw), yaw
    end = yaw + curvature * length
    return x + (sin(end) - sin(yaw)) / curvature, y - (cos(end) - cos(yaw)) / curvature, end
