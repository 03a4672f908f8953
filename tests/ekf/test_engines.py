"""Claims about the two EKF engines: Jacobians, equality, positive covariance."""

import math
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lodeline.ekf.belief import Belief, certain
from lodeline.ekf.engine import Detection, Noise
from lodeline.ekf.engines import make_engine
from lodeline.ekf.motion import Delta, part, relative, twist
from lodeline.ekf.scalar_engine import ScalarEngine

SCALAR = ScalarEngine()
STILL = Noise(0.0, 0.0, 0.0)
POSE = (0.3, -0.2, 0.7)
STEP = Delta(0.021, 0.003, 0.25)
Pose = tuple[float, float, float]


def jacobian(function: Callable[..., Pose], at: tuple[float, ...]) -> np.ndarray:
    """Central differences, columns over the arguments."""
    h = 1e-6
    columns = []
    for i in range(len(at)):
        plus = function(*(a + h * (i == j) for j, a in enumerate(at)))
        minus = function(*(a - h * (i == j) for j, a in enumerate(at)))
        columns.append((np.array(plus) - np.array(minus)) / (2 * h))
    return np.array(columns).T


def matrix(belief: Belief) -> np.ndarray:
    return np.array(belief.covariance).reshape(3, 3)


def moved(x: float, y: float, yaw: float, ds: float = 0.0, dtheta: float = 0.0) -> Pose:
    """The midpoint model with additions to its input: f(X, U)."""
    course = yaw + 0.5 * (STEP.turn + dtheta)
    way = math.hypot(STEP.ahead, STEP.left) + ds
    return x + way * math.cos(course), y + way * math.sin(course), yaw + STEP.turn + dtheta


MIDPOINT = Delta(
    math.hypot(STEP.ahead, STEP.left) * math.cos(0.5 * STEP.turn),
    math.hypot(STEP.ahead, STEP.left) * math.sin(0.5 * STEP.turn),
    STEP.turn,
)


def test_the_prediction_carries_the_covariance_as_the_differences_of_its_model_do() -> None:
    p = np.diag([1e-4, 2e-4, 3e-3])
    start = Belief(*POSE, 1e-4, 0.0, 0.0, 2e-4, 0.0, 3e-3)
    after = SCALAR.predict(start, MIDPOINT, STILL)
    assert after[:3] == pytest.approx(moved(*POSE), abs=1e-12)
    a = jacobian(lambda x, y, yaw: moved(x, y, yaw), POSE)
    assert matrix(after) == pytest.approx(a @ p @ a.T, abs=1e-12)


def test_the_input_noise_comes_in_by_the_differences_of_the_input() -> None:
    noise = Noise(4e-6, 3e-5, 9e-4, 1e-7, 2e-6)
    after = SCALAR.predict(certain(*POSE), MIDPOINT, noise)
    b = jacobian(lambda ds, dtheta: moved(*POSE, ds, dtheta), (0.0, 0.0))
    q = np.array([[4e-6, 3e-5], [3e-5, 9e-4]])
    expected = b @ q @ b.T + np.diag([1e-7, 1e-7, 2e-6])
    assert matrix(after) == pytest.approx(expected, abs=1e-12)


def test_the_measurement_jacobian_is_that_of_the_differences() -> None:
    """S is linear in P: P = unit matrices show every product of the columns of H."""
    detection = Detection(0.08, 0.015, 1e-12, 1e-12, 0.385, -0.11)

    def h(x: float, y: float, yaw: float) -> Pose:
        seen = relative(x, y, yaw, detection.magnet_x, detection.magnet_y, 0.0)
        return seen.ahead, seen.left, 0.0

    by_differences = jacobian(h, POSE)[:2]
    for i in range(3):
        p = np.zeros((3, 3))
        p[i, i] = 1.0
        belief = Belief(*POSE, p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2])
        weighed = SCALAR.weigh(belief, detection)
        expected = by_differences @ p @ by_differences.T
        assert (weighed.s00, weighed.s01, weighed.s11) == pytest.approx(
            (expected[0, 0], expected[0, 1], expected[1, 1]), abs=1e-8
        )


def test_a_sure_detection_moves_the_robot_onto_it() -> None:
    belief = certain(0.0, 0.0, 0.0).widened(0.01, 1e-6)
    seen = Detection(0.080, 0.010, 1e-12, 1e-12, 0.083, 0.008)
    after = SCALAR.correct(belief, seen)
    assert (after.x, after.y) == pytest.approx((0.003, -0.002), abs=1e-6)


def random_step(rng: Random) -> tuple[Delta, Noise, Detection]:
    correlation = rng.uniform(-0.99, 0.99)
    ss, tt = 10 ** rng.uniform(-9, -5), 10 ** rng.uniform(-7, -3)
    noise = Noise(ss, correlation * math.sqrt(ss * tt), tt, rng.choice([0.0, 1e-7]), 0.0)
    delta = Delta(rng.gauss(0, 0.02), rng.gauss(0, 0.005), rng.gauss(0, 0.3))
    detection = Detection(
        0.08, rng.uniform(-0.035, 0.035), 10 ** rng.uniform(-6, -4), 1e-5, 0.0, 0.0
    )
    return delta, noise, detection


def test_scalar_and_filterpy_are_equal_to_1e_9_over_100000_random_steps() -> None:
    """In one go: each engine goes its own way from the first step to the last."""
    rng, filterpy = Random(7), make_engine("filterpy")
    a = b = certain(0.0, 0.0, 0.0).widened(0.01, 0.1)
    worst = 0.0
    for _ in range(100_000):
        delta, noise, seen = random_step(rng)
        a, b = SCALAR.predict(a, delta, noise), filterpy.predict(b, delta, noise)
        c, s = math.cos(a.yaw), math.sin(a.yaw)
        ahead, left = 0.08 + rng.gauss(0, 0.003), seen.left + rng.gauss(0, 0.003)
        magnet = (a.x + c * ahead - s * left, a.y + s * ahead + c * left)
        seen = seen._replace(magnet_x=magnet[0], magnet_y=magnet[1])
        by_a, by_b = SCALAR.weigh(a, seen), filterpy.weigh(b, seen)
        worst = max(worst, abs(by_a.nis - by_b.nis) / (1.0 + by_b.nis))
        a, b = SCALAR.correct(a, seen), filterpy.correct(b, seen)
        turned = math.remainder(a.yaw - b.yaw, 2 * math.pi)
        differences = [x - y for x, y in zip(a, b, strict=True)]
        differences[2] = turned
        worst = max(worst, *map(abs, differences))
    assert worst < 1e-9


@pytest.mark.parametrize("name", ["scalar", "filterpy"])
def test_the_covariance_stays_positive_with_r_over_twelve_decades(name: str) -> None:
    rng, engine = Random(3), make_engine("filterpy" if name == "filterpy" else "scalar")
    for _ in range(40 if name == "filterpy" else 400):
        belief = certain(0.0, 0.0, 0.0).widened(10 ** rng.uniform(-6, 1), 10 ** rng.uniform(-6, 0))
        for _ in range(20):
            delta, noise, seen = random_step(rng)
            belief = engine.predict(belief, delta, noise)
            seen = seen._replace(
                ahead_variance=10 ** rng.uniform(-10, 2), left_variance=10 ** rng.uniform(-10, 2)
            )
            belief = engine.correct(belief, seen).positive()
            eigenvalues = np.linalg.eigvalsh(matrix(belief))
            assert belief.finite
            assert min(belief.p00, belief.p11, belief.p22) > 0.0
            assert eigenvalues[0] > 0.0


def test_a_covariance_that_is_not_positive_is_raised_until_it_is() -> None:
    for broken in (
        Belief(0, 0, 0, 1e-4, 1.0001e-4, 0.0, 1e-4, 0.0, 1e-3),
        Belief(0, 0, 0, 1e-4, 0.0, 0.0, -1e-20, 0.0, 1e-3),
        Belief(0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        Belief(0, 0, 0, 1e-4, 5.0, 0.0, 1e-4, 0.0, 1e-3),
    ):
        raised = matrix(broken.positive())
        assert np.linalg.eigvalsh(raised)[0] > 0.0
        assert np.all(np.diag(raised) >= np.abs(np.diag(matrix(broken))))


@example(0.0, 1.0, 1e-8, 0.0, 0.5)
@given(
    st.floats(-1, 1), st.floats(-1, 1), st.floats(-3.1, 3.1), st.floats(0.0, 1.0), st.floats(0, 1)
)
def test_the_parts_of_a_motion_make_the_whole(
    ahead: float, left: float, turn: float, first: float, second: float
) -> None:
    whole = Delta(ahead, left, turn)
    cuts = [0.0, *sorted((first, second)), 1.0]
    belief = certain(*POSE)
    for begin, end in pairwise(cuts):
        belief = SCALAR.predict(belief, part(twist(whole), end - begin), STILL)
    at_once = SCALAR.predict(certain(*POSE), whole, STILL)
    assert belief[:2] == pytest.approx(at_once[:2], abs=1e-12)
    assert math.remainder(belief.yaw - at_once.yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)


def test_half_of_an_arc_is_half_an_arc() -> None:
    quarter_circle = Delta(1.0, 1.0, math.pi / 2)
    half = part(twist(quarter_circle), 0.5)
    assert half == pytest.approx((math.sin(math.pi / 4), 1 - math.cos(math.pi / 4), math.pi / 4))


def test_nothing_scalar_imports_numpy() -> None:
    """numpy and scipy cost seconds at start: only the filterpy engine may ask for them."""
    code = (
        "import sys, lodeline.odometry, lodeline.magnets, lodeline.ekf as e;"
        "e.Localizer(e.LocalizerParams());"
        "print(sorted({'numpy', 'scipy', 'filterpy', 'zenoh', 'lodeline_msgs'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=30
    )
    assert done.stdout.strip() == "[]"
