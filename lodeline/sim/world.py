"""A differential-drive robot on a floor: how it truly moves.

Frames: ENU world, FLU body on the wheel axle. The motion is computed in steps of 2 ms and depends
on the seed, the commands and the number of the step only, never on when it is looked at.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import atan2, cos, exp, isfinite, pi, sin, sqrt
from typing import NamedTuple

from lodeline.sim.course import Course
from lodeline.sim.noise import Noise
from lodeline.sim.params import RobotParams, Vector

STEP = 0.002  # s
HISTORY = 1024  # steps that can still be looked at: 2 s, more than any chip holds a sample
COMMAND_LIFE = 0.5  # s
MOTOR_LAG = 0.05  # s
GRAVITY = 9.80665  # m/s^2
HEADING_GAIN = 4.0  # 1/s
APPROACH = 8.0  # rad/m, how steeply the robot returns to its course
MAX_SPEED = 0.5  # m/s and
MAX_RATE = 4.0  # rad/s, more than which the motors do not give


@dataclass(slots=True)
class WorldState:
    """Everything that the next step depends on; yaw [rad] and course position [m] unwrapped."""

    step: int = 0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    v: float = 0.0
    w: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    height: float = 0.0
    climb: float = 0.0
    left_angle: float = 0.0
    right_angle: float = 0.0
    left_speed: float = 0.0
    right_speed: float = 0.0
    left_slip: float = 0.0
    right_slip: float = 0.0
    course_at: float = 0.0
    on_course: bool = True
    command_v: float = 0.0
    command_w: float = 0.0
    command_until: float = -1.0


class Motion(NamedTuple):
    """The truth at one moment: SI, radians; rates and force in the body's axes."""

    x: float
    y: float
    yaw: float
    roll: float
    pitch: float
    v: float
    w: float
    left_angle: float
    right_angle: float
    angular_velocity: Vector
    specific_force: Vector


class World:
    """Moves the robot. Times are seconds since the world began."""

    def __init__(self, params: RobotParams, state: WorldState | None = None) -> None:
        self._params = params
        self._course = Course(params.course_straight, params.course_radius)
        self._noise = Noise(params.seed, 0)
        self._keep = exp(-STEP / params.slip_time)
        self._stir = params.slip * sqrt(1.0 - self._keep**2)
        self.state = state if state is not None else WorldState()
        self._motions: deque[Motion] = deque(maxlen=HISTORY)
        self._motions.append(self._motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))

    @property
    def now(self) -> float:
        """Time of the newest step [s]."""
        return self.state.step * STEP

    def command(self, now: float, v: float, w: float) -> None:
        """Drive at v [m/s] and w [rad/s] for the next 0.5 s instead of along the course.

        Raises ValueError if one is not finite.
        """
        if not (isfinite(v) and isfinite(w)):
            raise ValueError(f"no robot drives at {v} m/s and {w} rad/s")
        self.advance(now)
        self.state.command_v = _clip(v, MAX_SPEED)
        self.state.command_w = _clip(w, MAX_RATE)
        self.state.command_until = now + COMMAND_LIFE

    def advance(self, t: float) -> None:
        """Make all steps up to time `t` [s]."""
        for _ in range(int(t / STEP + 1e-6) - self.state.step):
            self._motions.append(self._step())

    def at(self, t: float) -> Motion:
        """Return the motion in the step of time `t` [s]; 2 s of it are kept."""
        self.advance(t)
        back = self.state.step - int(t / STEP + 1e-6)
        return self._motions[-1 - min(back, len(self._motions) - 1)]

    def _step(self) -> Motion:
        state, p = self.state, self._params
        v, w = self._wanted()
        lag = STEP / MOTOR_LAG
        before = (state.roll, state.pitch, state.yaw, state.v, state.climb)
        turn = 0.5 * w * p.track
        state.left_speed += lag * ((v - turn) / p.wheel_radius - state.left_speed)
        state.right_speed += lag * ((v + turn) / p.wheel_radius - state.right_speed)
        state.left_angle += state.left_speed * STEP
        state.right_angle += state.right_speed * STEP
        kick_left, kick_right = self._noise.pair(state.step)
        state.left_slip = self._keep * state.left_slip + self._stir * kick_left
        state.right_slip = self._keep * state.right_slip + self._stir * kick_right
        left = state.left_speed * p.wheel_radius * (1.0 + p.left_scale_error + state.left_slip)
        right = state.right_speed * p.wheel_radius * (1.0 + p.right_scale_error + state.right_slip)
        state.v = 0.5 * (left + right)
        state.w = (right - left) / p.track
        middle = state.yaw + 0.5 * state.w * STEP
        state.x += state.v * cos(middle) * STEP
        state.y += state.v * sin(middle) * STEP
        state.yaw += state.w * STEP
        state.step += 1
        self._tilt()
        return self._motion(*self._felt(*before))

    def _wanted(self) -> tuple[float, float]:
        """Return (v, w): the command while it is fresh, else what keeps the robot on its course."""
        state, p = self.state, self._params
        if self.now < state.command_until:
            state.on_course = False
            return state.command_v, state.command_w
        if self.now < p.standing:
            return 0.0, 0.0
        if not state.on_course:
            state.course_at = self._course.nearest(state.x, state.y)
            state.on_course = True
        x, y, yaw, curvature = self._course.at(state.course_at)
        dx, dy = state.x - x, state.y - y
        aside = dy * cos(yaw) - dx * sin(yaw)
        ahead = dx * cos(yaw) + dy * sin(yaw)
        aim = yaw - _clip(APPROACH * aside, 0.5 * pi)
        off = atan2(sin(aim - state.yaw), cos(aim - state.yaw))
        # the point on the course is led along beside the robot
        state.course_at += max(0.0, ahead + state.v * cos(state.yaw - yaw) * STEP)
        w = p.speed * curvature + HEADING_GAIN * off if p.speed else 0.0
        return p.speed, _clip(w, MAX_RATE)

    def _tilt(self) -> None:
        """Stand the robot on the floor under its wheels and its castor."""
        state, p = self.state, self._params
        half = 0.5 * p.track * sin(state.yaw)
        left = self._floor(state.x - half)
        right = self._floor(state.x + half)
        axle = 0.5 * (left + right)
        behind = self._floor(state.x - p.castor * cos(state.yaw))
        state.roll = (left - right) / p.track
        state.pitch = (behind - axle) / p.castor
        state.climb = (axle - state.height) / STEP
        state.height = axle

    def _floor(self, x: float) -> float:
        """Height of the floor [m]: a strip with the profile of a raised cosine."""
        p = self._params
        off = (x - p.bump_x) / p.bump_width
        return 0.5 * p.bump_height * (1.0 + cos(2.0 * pi * off)) if abs(off) < 0.5 else 0.0

    def _felt(
        self, roll: float, pitch: float, yaw: float, v: float, climb: float
    ) -> tuple[Vector, Vector]:
        """Return what changed in this step, as angular velocity and specific force in the body."""
        state = self.state
        sr, cr, sp, cp = sin(state.roll), cos(state.roll), sin(state.pitch), cos(state.pitch)
        droll = (state.roll - roll) / STEP
        dpitch = (state.pitch - pitch) / STEP
        dyaw = (state.yaw - yaw) / STEP
        rates = (
            droll - sp * dyaw,
            cr * dpitch + sr * cp * dyaw,
            -sr * dpitch + cr * cp * dyaw,
        )
        forward = (state.v - v) / STEP
        aside = state.v * state.w  # towards the centre of the turn
        up = (state.climb - climb) / STEP + GRAVITY
        force = (  # the level vector, turned by pitch and then by roll
            cp * forward - sp * up,
            sr * sp * forward + cr * aside + sr * cp * up,
            cr * sp * forward - sr * aside + cr * cp * up,
        )
        return rates, force

    def _motion(self, rates: Vector, force: Vector) -> Motion:
        s = self.state
        yaw = atan2(sin(s.yaw), cos(s.yaw))
        return Motion(
            s.x, s.y, yaw, s.roll, s.pitch, s.v, s.w, s.left_angle, s.right_angle, rates, force
        )


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
