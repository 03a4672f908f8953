"""Claims about the paper's experiment: quarter turns on a slope, to and fro, arc by arc.

Simulated after Table 1 of Herman et al.: the sensor is pitched by 0 to 40 degrees on a turntable
with a vertical axis that goes 90 degrees right and left again. The paper found mean arcs 0.43 to
2.43 degrees off and standard deviations up to 5.82 degrees.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import cos, degrees, hypot, pi, radians, sin
from random import Random
from statistics import fmean, stdev

import pytest

from lodeline.attitude import make_attitude
from lodeline.rotation import Vector, conjugate, from_euler, rotate, wrap_angle, yaw_of

RATE = 50.0  # Hz, as on the PSoC
FIELD: Vector = (0.0, 24e-6, -41e-6)  # Los Angeles: dip 59 degrees
ARC = radians(90.0)
START = radians(45.0)  # heading 45 degrees, which is yaw 45
BEFORE, TURN, REST = 5.0, 1.0, 1.5  # seconds; the servo buzzes after `BEFORE`, without a pause
TURNS = 40
GYRO_NOISE, FORCE_NOISE, FIELD_NOISE = 0.002, 0.04, 4e-7  # of an MPU-9150 at 50 Hz


def stop_to_stop() -> Iterator[tuple[float, float, bool]]:
    """(yaw, yaw rate, is this the end of a rest) at every sample."""
    for turn in range(TURNS + 1):
        right = turn % 2 == 0
        for i in range(round(TURN * RATE)):
            phase = pi * (i + 1) / (TURN * RATE)
            way, speed = 0.5 * (1 - cos(phase)), 0.5 * pi / TURN * sin(phase)
            sign = -1.0 if right else 1.0
            yield START + (0.0 if right else -ARC) + sign * ARC * way, sign * ARC * speed, False
        stop = START - ARC if right else START
        for i in range(round(REST * RATE)):
            yield stop, 0.0, i == round(REST * RATE) - 1


def arcs(method: str, pitch: float, buzz: float) -> list[float]:
    """The size of every arc [deg] as the method saw it, stop to stop."""
    rng = Random(f"{pitch} {buzz}")
    estimator = make_attitude(method)
    slope = from_euler(0.0, radians(pitch), 0.0)
    up = rotate(conjugate(slope), (0.0, 0.0, 1.0))
    stops: list[float] = []
    still = [(START, 0.0, False)] * round(BEFORE * RATE)
    for i, (yaw, speed, stopped) in enumerate([*still, *stop_to_stop()]):
        field = rotate(conjugate(from_euler(0.0, radians(pitch), yaw)), FIELD)
        force = noisy(rng, (9.81 * up[0], 9.81 * up[1], 9.81 * up[2]), FORCE_NOISE)
        if i >= len(still):
            force = shaken(rng, force, buzz)
        estimator.update(
            1.0 / RATE,
            noisy(rng, (up[0] * speed, up[1] * speed, up[2] * speed), GYRO_NOISE),
            force,
            noisy(rng, field, FIELD_NOISE),
        )
        if stopped:
            stops.append(yaw_of(estimator.orientation))
    return [abs(degrees(wrap_angle(b - a))) for a, b in pairwise(stops)]


def noisy(rng: Random, v: Vector, std: float) -> Vector:
    return (v[0] + rng.gauss(0.0, std), v[1] + rng.gauss(0.0, std), v[2] + rng.gauss(0.0, std))


def shaken(rng: Random, v: Vector, amplitude: float) -> Vector:
    """A buzz far above the sampling rate: its phase at a sample is anything, its direction too."""
    x, y, z = noisy(rng, (0.0, 0.0, 0.0), 1.0)
    k = amplitude * cos(rng.uniform(0.0, 2 * pi)) / hypot(x, y, z)
    return (v[0] + k * x, v[1] + k * y, v[2] + k * z)


@pytest.mark.parametrize("method", ["soft", "dcm"])
@pytest.mark.parametrize("pitch", [0, 10, 20, 30, 40])
@pytest.mark.parametrize(("buzz", "largest_sd"), [(0.0, 0.2), (5.0, 1.2)])
def test_quarter_turns_keep_their_size_on_a_slope(
    method: str, pitch: float, buzz: float, largest_sd: float
) -> None:
    seen = arcs(method, pitch, buzz)
    print(f"{method} pitch {pitch} buzz {buzz}: {fmean(seen):.3f} sd {stdev(seen):.3f}")
    assert fmean(seen) == pytest.approx(90.0, abs=0.35)
    assert stdev(seen) <= largest_sd
