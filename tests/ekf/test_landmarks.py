"""Claims about landmarks: ranges, bearings and positions in the same filter as the magnets."""

import math
from random import Random

import pytest

from lodeline.ekf import Belief, Estimate, Localizer, LocalizerParams, Sighting
from lodeline.ekf.belief import certain
from lodeline.ekf.engine import EngineName
from lodeline.ekf.landmarks import numbers, weighed
from lodeline.ekf.samples import Fix

MS = 1_000_000
NOISE = (1e-3, 0.0, 0.0, 1e-2)
STILL = (0.0, 0.0, 0.0, 0.0)
BEACONS = ((0.0, 3.0), (4.0, -1.0), (-2.0, -2.0))


def of(localizer: Localizer) -> Estimate:
    estimate = localizer.estimate
    assert estimate is not None
    return estimate


def seen_from(x: float, y: float, yaw: float, mark: tuple[float, float]) -> tuple[float, float]:
    dx, dy = mark[0] - x, mark[1] - y
    return math.hypot(dx, dy), math.remainder(math.atan2(dy, dx) - yaw, 2 * math.pi)


@pytest.mark.parametrize("pose", [(0.3, -0.2, 0.7), (-1.0, 2.0, -3.0)])
def test_the_rows_are_the_differences_of_the_measurements(pose: tuple[float, float, float]) -> None:
    landmarks = (Sighting(2.0, 1.0, 2.0, 0.1, 0.3, 0.1), Fix(0, 0.5, 0.5, 0.1))
    h = 1e-6
    for landmark in landmarks:
        for i in range(3):
            plus, minus = list(pose), list(pose)
            plus[i], minus[i] = pose[i] + h, pose[i] - h
            at = numbers(certain(*pose), landmark)
            up = numbers(certain(plus[0], plus[1], plus[2]), landmark)
            down = numbers(certain(minus[0], minus[1], minus[2]), landmark)
            for here, a, b in zip(at, up, down, strict=True):
                assert here.row[i] == pytest.approx((b.residual - a.residual) / (2 * h), abs=1e-6)


def test_two_numbers_are_weighed_with_their_correlation() -> None:
    import numpy as np

    belief = Belief(0.1, 0.2, 0.3, 0.02, 0.01, 0.003, 0.03, -0.002, 0.01)
    seen = numbers(belief, Sighting(2.0, 1.0, 2.5, 0.1, 0.4, 0.05))
    rows = np.array([each.row for each in seen])
    s = rows @ np.array(belief.covariance).reshape(3, 3) @ rows.T
    r = np.diag([each.variance for each in seen])
    y = np.array([each.residual for each in seen])
    nis, likelihood = weighed(belief, seen)
    assert nis == pytest.approx(y @ np.linalg.solve(s + r, y))
    share = math.sqrt(np.linalg.det(r) / np.linalg.det(s + r))
    assert likelihood == pytest.approx(share * math.exp(-0.5 * nis))


def landmark(kind: str, drive: tuple[float, float, float], rng: Random) -> Sighting | Fix:
    mark = rng.choice(BEACONS)
    distance, bearing = seen_from(*drive, mark)
    distance, bearing = distance + rng.gauss(0, 0.05), bearing + rng.gauss(0, 0.05)
    if kind == "fix":
        return Fix(0, drive[0] + rng.gauss(0, 0.05), drive[1] + rng.gauss(0, 0.05), 0.05)
    if kind == "range":
        return Sighting(*mark, distance, 0.05)
    if kind == "bearing":
        return Sighting(*mark, None, 1.0, bearing, 0.05)
    return Sighting(*mark, distance, 0.05, bearing, 0.05)


def tell(localizer: Localizer, stamp: int, what: Sighting | Fix) -> None:
    if isinstance(what, Fix):
        localizer.position(stamp, what.x, what.y, what.sigma)
    else:
        localizer.landmarks(stamp, (what,))


@pytest.mark.parametrize("engine", ["scalar", "filterpy"])
@pytest.mark.parametrize("kind", ["range", "bearing", "both", "fix"])
def test_each_kind_of_landmark_keeps_the_robot_where_it_is(kind: str, engine: EngineName) -> None:
    """30 s of circles with noisy odometry, which alone ends more than 0.1 m off."""
    rng = Random(6)
    params = LocalizerParams(engine=engine, initial_sigma=(0.05, 0.1), magnet_model="none")
    localizer = Localizer(params)
    x = y = yaw = ox = oy = oyaw = 0.0
    squares, nees = [], []
    for i in range(600):
        way, turn = 0.02, 0.03
        x, y, yaw = x + way * math.cos(yaw), y + way * math.sin(yaw), yaw + turn
        way, turn = way + rng.gauss(0, 0.003), turn + rng.gauss(0, 0.01)
        ox, oy = ox + way * math.cos(oyaw), oy + way * math.sin(oyaw)
        oyaw = math.remainder(oyaw + turn, 2 * math.pi)
        noise = (0.003**2 / 0.05**2, 0.0, 0.0, 0.01**2 / 0.05**2)
        localizer.odometry(i * 50 * MS, ox, oy, oyaw, noise, 0.05, 0)
        if i % 4 == 0:
            tell(localizer, i * 50 * MS, landmark(kind, (x, y, yaw), rng))
        estimate = of(localizer)
        assert not estimate.ambiguous
        if i > 100:
            e2 = (estimate.x - x) ** 2 + (estimate.y - y) ** 2
            squares.append(e2)
            nees.append(e2 / (estimate.covariance[0] + estimate.covariance[4]))
    rms = math.sqrt(sum(squares) / len(squares))
    print(
        f"{kind}: rms {1e3 * rms:.0f} mm, squared error over variance {sum(nees) / len(nees):.2f}"
    )
    assert rms < 0.06
    assert 0.3 < sum(nees) / len(nees) < 2.0
    assert math.hypot(ox - x, oy - y) > 0.1


def test_an_outlier_moves_nothing_and_is_counted() -> None:
    localizer = Localizer(LocalizerParams(initial_sigma=(0.05, 0.05)))
    localizer.odometry(0, 0.0, 0.0, 0.0, STILL, 0.0, 0)
    before = of(localizer)
    after = localizer.landmarks(0, (Sighting(3.0, 0.0, 5.0, 0.1),))
    assert after is not None
    assert (after.x, after.y, after.rejected) == (before.x, before.y, 1)
    assert after.covariance == before.covariance


def test_landmarks_are_not_rejected_for_ever() -> None:
    localizer = Localizer(LocalizerParams(initial_sigma=(0.01, 0.01)))
    for i in range(60):
        localizer.odometry(i * 50 * MS, 0.0, 0.0, 0.0, STILL, 0.05, 0)
        localizer.position(i * 50 * MS, 1.0, 0.5, 0.05)
    assert math.hypot(of(localizer).x - 1.0, of(localizer).y - 0.5) < 0.05


def test_one_landmark_tells_which_magnet_it_was() -> None:
    """A position to 10 mm resolves what magnets never could."""
    params = LocalizerParams(initial_pose=(-0.020, 0.0, 0.0), initial_sigma=(0.030, 0.05))
    localizer = Localizer(params)
    localizer.odometry(0, 0.0, 0.0, 0.0, STILL, 0.0, 0)
    localizer.magnets(0, (0.0,))
    assert of(localizer).ambiguous
    localizer.odometry(50 * MS, 0.0, 0.0, 0.0, STILL, 0.05, 0)
    localizer.position(50 * MS, 0.030, 0.0, 0.010)
    found = of(localizer)
    assert not found.ambiguous
    assert found.x == pytest.approx(0.030, abs=0.006)  # the neighbour: one pitch ahead


def test_landmarks_give_a_robot_that_was_moved_its_trust_back() -> None:
    localizer = Localizer(LocalizerParams())
    mark, far = (1.0, 0.0), (0.0, 1.0)
    tilted = (math.sin(0.13), 0.0, 0.0, math.cos(0.13))
    for i in range(60):
        localizer.odometry(i * 10 * MS, 0.0, 0.0, 0.0, STILL, 0.01, 0)
        localizer.attitude(i * 10 * MS, tilted, (0.0, 0.0, 0.0), 0.02, disturbed=False)
    assert of(localizer).alarms == 1
    for i in range(60, 80):
        localizer.odometry(i * 10 * MS, 0.0, 0.0, 0.0, STILL, 0.01, 0)
        seen = tuple(
            Sighting(*each, 1.0, 0.01, seen_from(0, 0, 0, each)[1], 0.01) for each in (mark, far)
        )
        localizer.landmarks(i * 10 * MS, seen)
    assert of(localizer).alarms == 0
    assert not of(localizer).ambiguous


def test_landmarks_in_any_order_give_the_same_state() -> None:
    rng = Random(3)
    samples: list[tuple[int, Sighting | Fix | float]] = []
    for i in range(18):
        samples.append((i * 40 * MS, 0.01 * i))
        both = landmark("both", (0.01 * i, 0.0, 0.0), rng)
        samples.append((i * 40 * MS + rng.randrange(-15, 15) * MS, both))

    def fed(order: list[tuple[int, Sighting | Fix | float]]) -> Estimate:
        localizer = Localizer(LocalizerParams(magnet_model="none"))
        for stamp, what in order:
            if isinstance(what, float):
                localizer.odometry(stamp, what, 0.0, 0.0, NOISE, 0.04, 0)
            else:
                tell(localizer, stamp, what)
        return of(localizer)

    # the first odometry starts the run: what came before it tells nothing
    first, *rest = samples
    a = fed([first, *sorted(rest, key=lambda each: (each[0], not isinstance(each[1], float)))])
    rng.shuffle(rest)
    b = fed([first, *rest])
    assert (a.x, a.y, a.yaw, *a.covariance) == pytest.approx(
        (b.x, b.y, b.yaw, *b.covariance), abs=1e-12
    )


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e300])
def test_landmarks_that_make_no_sense_are_refused(bad: float) -> None:
    localizer = Localizer(LocalizerParams())
    localizer.odometry(0, 0.0, 0.0, 0.0, STILL, 0.0, 0)
    wrong = [
        Sighting(bad, 0.0, 1.0, 0.1),
        Sighting(0.0, 0.0, bad, 0.1),
        Sighting(0.0, 0.0, 1.0, bad),
        Sighting(0.0, 0.0, 1.0, 0.1, bad, 0.1),
        Sighting(0.0, 0.0, None, 0.1),
        Sighting(0.0, 0.0, 1.0, 0.0),
    ]
    for each in wrong:
        assert localizer.landmarks(0, (each,)) is None
    assert localizer.position(0, 0.0, bad, 0.1) is None
    assert localizer.position(0, 0.0, 0.0, -0.1) is None
    assert localizer.refused == len(wrong) + 2
