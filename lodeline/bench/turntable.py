"""The apparatus of the DCM paper, simulated: a plate, pitched and fixed, that a servo turns.

Herman et al., section VI: from a heading of 45 degrees the yaw servo goes 90 degrees counter-
clockwise and back again, a hundred times, at a pitch of 0 to 40 degrees; a short wait after each
turn. The sensor is their MPU-9150, at 50 Hz. Noise by its data sheets: gyro 0.005 deg/s/sqrt(Hz),
accelerometer 0.4 mg/sqrt(Hz), both through the 20 Hz low-pass that suits 50 Hz; AK8975 0.3 uT a
count, a third of a microtesla of noise. The field is that of Los Angeles. A calibrated gyro keeps
0.02 deg/s of its bias. A servo that buzzes shakes the plate while it turns and while it holds: far
above the sampling rate, so its phase at a sample is any, and so is its direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, degrees, hypot, pi, radians, sin, sqrt
from random import Random
from typing import NamedTuple

from lodeline.attitude.base import GRAVITY
from lodeline.rotation import Vector, conjugate, from_euler, rotate

RATE = 50.0  # Hz
BAND = 20.0  # Hz
GYRO_NOISE = radians(0.005) * sqrt(BAND)
GYRO_BIAS = radians(0.02)
ACCEL_NOISE = 0.0004 * GRAVITY * sqrt(BAND)
MAG_NOISE = 3.5e-7
MAG_STEP = 3e-7  # T a count
FIELD: Vector = (0.0, 24e-6, -41e-6)  # dip 59.6 degrees
ARC = radians(90.0)
START = radians(45.0)  # heading 45 degrees is yaw 45 degrees, both halfway between north and east
BEFORE, TURN, WAIT = 5.0, 1.0, 1.5  # s
TURNS = 100  # each way


class Reading(NamedTuple):
    """One sample, and the number of the stop whose last sample it is (None in between)."""

    dt: float
    rate: Vector
    force: Vector
    field: Vector
    stop: int | None


@dataclass(frozen=True, slots=True)
class Setup:
    """How the plate stands [rad], how hard the servo shakes it [m/s^2], how often it turns."""

    pitch: float
    buzz: float = 0.0
    turns: int = TURNS


def readings(setup: Setup) -> Iterator[Reading]:
    """What the sensor reads; stops with even numbers are at the clockwise end."""
    rng = Random(f"{degrees(setup.pitch):.3f} {setup.buzz}")
    slope = conjugate(from_euler(0.0, setup.pitch, 0.0))
    up = rotate(slope, (0.0, 0.0, 1.0))
    gravity = (GRAVITY * up[0], GRAVITY * up[1], GRAVITY * up[2])
    for yaw, speed, buzzing, stop in _servo(setup.turns):
        force = _noisy(rng, gravity, ACCEL_NOISE)
        if buzzing:
            force = _shaken(rng, force, setup.buzz)
        north = rotate(conjugate(from_euler(0.0, setup.pitch, yaw)), FIELD)
        rate = (up[0] * speed + GYRO_BIAS, up[1] * speed - GYRO_BIAS, up[2] * speed + GYRO_BIAS)
        field = _noisy(rng, north, MAG_NOISE)
        yield Reading(
            1.0 / RATE,
            _noisy(rng, rate, GYRO_NOISE),
            force,
            (_counted(field[0]), _counted(field[1]), _counted(field[2])),
            stop,
        )


def _servo(turns: int) -> Iterator[tuple[float, float, bool, int | None]]:
    """(yaw, yaw rate, does it buzz, number of the stop) at each sample."""
    still = round(BEFORE * RATE)
    for i in range(still):
        yield START, 0.0, False, 0 if i == still - 1 else None
    moving, waiting = round(TURN * RATE), round(WAIT * RATE)
    for stop in range(1, 2 * turns + 1):
        sign = 1.0 if stop % 2 else -1.0
        begin = START if stop % 2 else START + ARC
        for i in range(moving):
            phase = pi * (i + 1) / moving
            swing = 0.5 * pi / TURN * sin(phase)
            yield begin + sign * ARC * 0.5 * (1.0 - cos(phase)), sign * ARC * swing, True, None
        for i in range(waiting):
            yield begin + sign * ARC, 0.0, True, stop if i == waiting - 1 else None


def _noisy(rng: Random, v: Vector, std: float) -> Vector:
    return (v[0] + rng.gauss(0.0, std), v[1] + rng.gauss(0.0, std), v[2] + rng.gauss(0.0, std))


def _shaken(rng: Random, v: Vector, amplitude: float) -> Vector:
    x, y, z = _noisy(rng, (0.0, 0.0, 0.0), 1.0)
    k = amplitude * cos(rng.uniform(0.0, 2.0 * pi)) / hypot(x, y, z)
    return (v[0] + k * x, v[1] + k * y, v[2] + k * z)


def _counted(field: float) -> float:
    return MAG_STEP * round(field / MAG_STEP)
