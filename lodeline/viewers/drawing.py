"""What a viewer is shown of each sample: robot, trails, ellipse, magnets, attitude, numbers."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Protocol

from lodeline.ekf import LocalizerParams
from lodeline.keys import is_truth
from lodeline.magnets import Lattice
from lodeline.plotting.numbers import ellipse_axes
from lodeline.rotation import Quaternion, from_euler, to_euler
from lodeline_msgs import AttitudeEstimate, MagnetDetection, Message, Odometry, PoseEstimate

RATE_HZ = 50.0
"""Samples of a key that come faster are left out: no eye sees more."""
TRAIL_HZ = 4.0
TRAIL_POINTS, TRAIL_STEP = 4000, 0.005  # m
LATTICE_REACH = 1.1  # m
MOST_HITS = 300
ELLIPSE_SIDES = 48
BASE, MAP = "base_link", "map"
Point = tuple[float, float]


class Canvas(Protocol):
    """One viewer. Stamps are ns, lengths m, angles rad; names have `/` between their parts."""

    def points(self, stamp: int, name: str, points: Sequence[Point]) -> None:
        """Dots on the floor, instead of those of the same name before."""
        ...

    def line(self, stamp: int, name: str, points: Sequence[Point]) -> None:
        """A line on the floor, instead of the one of the same name before."""
        ...

    def frame(self, stamp: int, name: str, at: Point, orientation: Quaternion) -> None:
        """Where a frame is in `map`, and how it is turned (body to world)."""
        ...

    def scalars(self, stamp: int, key: str, values: Mapping[str, float]) -> None:
        """Numbers of one key to plot over time."""
        ...

    def close(self) -> None:
        """Nothing more is shown."""
        ...


class Drawing:
    """Draws samples of one run on a canvas; `take` belongs to one thread at a time."""

    def __init__(self, canvas: Canvas, params: LocalizerParams, keys: Mapping[str, str]) -> None:
        """`keys` are the classes of all keys, by which it is known what moves the robot."""
        self._canvas, self._params = canvas, params
        poses = [key for key, cls in keys.items() if cls == PoseEstimate.__name__]
        odometry = [
            key for key, cls in keys.items() if cls == Odometry.__name__ and not is_truth(key)
        ]
        self._leader = next(iter(poses + odometry), None)
        self._at: Point = (0.0, 0.0)
        self._yaw = 0.0
        self._tilt = (0.0, 0.0)
        self._due: dict[str, float] = {}
        self._trails: dict[str, deque[Point]] = {}
        self._hits: deque[Point] = deque(maxlen=MOST_HITS)

    def take(self, key: str, message: Message) -> None:
        """Show a sample; one of a class that nobody draws is left alone."""
        if isinstance(message, MagnetDetection):
            self._met(message)
        elif not self._is_due(key, message.stamp, RATE_HZ):
            return
        elif isinstance(message, PoseEstimate | Odometry):
            self._moved(key, message)
        elif isinstance(message, AttitudeEstimate):
            self._turned(key, message)

    def _is_due(self, what: str, stamp: int, rate: float) -> bool:
        """Whether it is time for the next of them; a stamp far back is of a clock set anew."""
        due = self._due.get(what, 0.0)
        if due - 2e9 / rate <= stamp < due:
            return False
        self._due[what] = stamp + 0.9e9 / rate
        return True

    def _moved(self, key: str, pose: PoseEstimate | Odometry) -> None:
        if self._is_due("magnets", pose.stamp, 1.0):  # again: there may be new viewers
            self._lay_magnets(pose.stamp)
        values = {"x": pose.x, "y": pose.y, "yaw": pose.yaw}
        if isinstance(pose, PoseEstimate):
            p = pose.covariance
            sigmas = (math.sqrt(max(0.0, p[place])) for place in (0, 4, 8))
            values |= dict(zip(("sigma_x", "sigma_y", "sigma_yaw"), sigmas, strict=True))
            values |= {"nis": pose.nis, "rejected": float(pose.rejected)}
            self._canvas.line(pose.stamp, f"ellipse/{key}", _ellipse(pose))
        else:
            values |= {"v": pose.v, "w": pose.w}
        self._canvas.scalars(pose.stamp, key, values)
        self._trail(key, pose)
        if key == self._leader:
            self._at, self._yaw = (pose.x, pose.y), pose.yaw
            turned = from_euler(*self._tilt, pose.yaw)
            self._canvas.frame(pose.stamp, BASE, self._at, turned)

    def _trail(self, key: str, pose: PoseEstimate | Odometry) -> None:
        trail = self._trails.setdefault(key, deque(maxlen=TRAIL_POINTS))
        if not trail or math.dist(trail[-1], (pose.x, pose.y)) >= TRAIL_STEP:
            trail.append((pose.x, pose.y))
        if self._is_due(f"trail {key}", pose.stamp, TRAIL_HZ):
            self._canvas.line(pose.stamp, f"trail/{key}", [*trail, (pose.x, pose.y)])

    def _turned(self, key: str, attitude: AttitudeEstimate) -> None:
        roll, pitch, yaw = to_euler(attitude.orientation)
        self._tilt = (roll, pitch)
        self._canvas.frame(attitude.stamp, key, self._at, attitude.orientation)
        values = {"roll": roll, "pitch": pitch, "yaw": yaw, "heading_std": attitude.heading_std}
        values |= {
            f"gyro_bias_{axis}": b for axis, b in zip("xyz", attitude.gyro_bias, strict=True)
        }
        self._canvas.scalars(attitude.stamp, key, values)

    def _met(self, detection: MagnetDetection) -> None:
        if not detection.lateral or self._leader is None:
            return
        c, s, ahead = math.cos(self._yaw), math.sin(self._yaw), self._params.bar_x
        self._hits.extend(
            (self._at[0] + c * ahead - s * left, self._at[1] + s * ahead + c * left)
            for left in detection.lateral
        )
        if self._is_due("hits", detection.stamp, TRAIL_HZ):
            self._canvas.points(detection.stamp, "hits", list(self._hits))

    def _lay_magnets(self, stamp: int) -> None:
        if self._params.magnet_model == "none":
            return
        lattice = Lattice(self._params.lattice_pitch, *self._params.lattice_origin)
        self._canvas.points(stamp, "magnets", list(lattice.around(*self._at, LATTICE_REACH)))


def _ellipse(pose: PoseEstimate) -> list[Point]:
    """The 95 % ellipse as a closed line."""
    a, b, angle = ellipse_axes(pose.covariance)
    c, s = math.cos(angle), math.sin(angle)
    rim = []
    for i in range(ELLIPSE_SIDES + 1):
        turn = 2.0 * math.pi * i / ELLIPSE_SIDES
        u, v = a * math.cos(turn), b * math.sin(turn)
        rim.append((pose.x + c * u - s * v, pose.y + s * u + c * v))
    return rim
