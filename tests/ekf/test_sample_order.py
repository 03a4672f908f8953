"""Claims about the history: any order of arrival gives the same state, and nothing is kept long."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lodeline.bench.scenes.drive import Drive
from lodeline.bench.scenes.rides import SIGMA, wheels_with
from lodeline.ekf import Estimate, Localizer, LocalizerParams
from lodeline.ekf.motion import relative
from lodeline.odometry import Odometry
from lodeline.rotation import from_euler

MS = 1_000_000
COVARIANCE = (1e-4, 2e-5, 2e-5, 4e-3)
Sample = tuple[str, int, tuple[float, ...]]


def drive(rng: Random, count: int, reset_at: int = -1) -> list[Sample]:
    """Odometry about every 50 ms along a bent way, readings of the bar at stamps of their own."""
    samples: list[Sample] = []
    x = y = yaw = 0.0
    stamp = 1_000 * MS
    for i in range(count):
        stamp += rng.randrange(5 * MS, 50 * MS)
        way, turn = rng.uniform(0.0, 0.008), rng.uniform(-0.1, 0.1)
        x, y = x + way * math.cos(yaw + turn / 2), y + way * math.sin(yaw + turn / 2)
        yaw = math.remainder(yaw + turn, 2 * math.pi)
        samples.append(("odometry", stamp, (x, y, yaw, 1 if 0 <= reset_at <= i else 0)))
        if rng.random() < 0.7:
            # often at the very stamp of the odometry, else anywhere around it
            at = stamp + rng.choice([0, rng.randrange(-40 * MS, 40 * MS)])
            laterals = tuple(rng.choice([-0.02, 0.0, 0.015]) for _ in range(rng.choice([0, 1, 1])))
            samples.append(("magnets", at, laterals))
    return samples


def fed(samples: list[Sample], params: LocalizerParams | None = None) -> Localizer:
    localizer = Localizer(params or LocalizerParams())
    for sample in samples:
        feed(localizer, sample)
    return localizer


def feed(localizer: Localizer, sample: Sample) -> bool:
    kind, stamp, values = sample
    if kind == "odometry":
        x, y, yaw, resets = values
        return localizer.odometry(stamp, x, y, yaw, COVARIANCE, 0.03, int(resets)) is not None
    if kind == "attitude":
        tilt, yaw, rate = values
        orientation = from_euler(tilt, 0.0, yaw)
        localizer.attitude(stamp, orientation, (0.0, 0.0, rate), 0.1, disturbed=False)
        return False
    return localizer.magnets(stamp, values) is not None


def numbers(localizer: Localizer) -> list[float]:
    """All that a localiser remembers and says."""

    def flat(value: object) -> Iterator[float]:
        if isinstance(value, dict | list | tuple):
            for part in value.values() if isinstance(value, dict) else value:
                yield from flat(part)
        elif value is not None:
            assert isinstance(value, int | float)
            yield value * 1e-9 if abs(value) > 1e9 else value  # stamps in s

    estimate = localizer.estimate
    assert estimate is not None
    state = asdict(localizer.state)
    del state["unused"]
    return [*flat(state), *flat(estimate)]


def once_each(samples: list[Sample]) -> list[Sample]:
    return list({(kind, stamp): (kind, stamp, values) for kind, stamp, values in samples}.values())


def check_any_order(rng: Random, params: LocalizerParams, reset_at: int) -> None:
    samples = once_each(drive(rng, 15, reset_at))  # within 0.83 s
    in_order = fed(sorted(samples, key=lambda each: (each[1], each[0] == "magnets")), params)
    shuffled = samples[:]
    rng.shuffle(shuffled)
    late = fed(shuffled, params)
    assert late.late == in_order.late == 0
    assert numbers(late) == pytest.approx(numbers(in_order), abs=1e-12)


@settings(max_examples=100, deadline=None)
@given(st.randoms(use_true_random=False), st.sampled_from(["edges", "plain"]))
def test_any_order_within_the_history_gives_the_same_state(rng: Random, model: str) -> None:
    params = LocalizerParams(magnet_model="plain" if model == "plain" else "edges")
    check_any_order(rng, params, -1)


@settings(max_examples=15, deadline=None)
@given(st.randoms(use_true_random=False), st.booleans())
def test_any_order_gives_the_same_hypotheses_too(rng: Random, reset: bool) -> None:
    """A robot put down with much doubt, or one whose encoders begin anew half-way."""
    sigma = (0.005, 0.05) if reset else (0.02, 0.1)
    check_any_order(rng, LocalizerParams(initial_sigma=sigma), 7 if reset else -1)


def spins(rng: Random) -> list[Sample]:
    """A gyro that now and then spikes or is silent, of a robot that is lifted now and then."""
    samples, tilt, at = list[Sample](), 0.0, 1_000 * MS
    while at < 1_900 * MS:
        tilt = rng.choice([0.0, 0.5]) if rng.random() < 0.03 else tilt
        rate = rng.uniform(-1.0, 1.0) if rng.random() > 0.1 else rng.uniform(-10.0, 10.0)
        samples.append(("attitude", at, (tilt, rng.uniform(-0.2, 0.2), rate)))
        at += rng.choice([5, 5, 5, 5, 5, 8, 20, 70]) * MS
    return samples


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000_000), st.booleans(), st.booleans())
def test_any_order_gives_the_same_with_gyro_and_compass(
    seed: int, compass: bool, learns: bool
) -> None:
    rng = Random(seed)
    params = LocalizerParams(
        heading="on" if compass else "off",
        heading_interval=0.1,
        wheel_sigma=(0.01, 0.01) if learns else (0.0, 0.0),
    )
    samples = once_each(drive(rng, 15) + spins(rng))
    order = {"odometry": 0, "magnets": 1, "attitude": 2}
    in_order = fed(sorted(samples, key=lambda each: (each[1], order[each[0]])), params)
    rng.shuffle(samples)
    assert numbers(fed(samples, params)) == pytest.approx(numbers(in_order), abs=1e-12)


def test_readings_400_ms_late_on_a_long_drive_are_fused_as_if_fresh() -> None:
    samples = once_each(drive(Random(5), 300))
    fresh = fed(sorted(samples, key=lambda each: (each[1], each[0] == "magnets")))

    def arrival(sample: Sample) -> int:
        return sample[1] + (400 * MS if sample[0] == "magnets" else 0)

    late = fed(sorted(samples, key=arrival))
    assert numbers(late) == pytest.approx(numbers(fresh), abs=1e-12)
    assert late.late == 0


def test_a_duplicate_changes_nothing_and_is_counted() -> None:
    samples = once_each(drive(Random(2), 10))
    once, twice = fed(samples), fed([each for each in samples for _ in range(2)])
    assert numbers(twice) == numbers(once)
    assert twice.duplicates == len(samples)


def test_what_is_older_than_the_history_is_dropped_and_counted() -> None:
    localizer = fed([("odometry", i * 100 * MS, (i * 0.01, 0.0, 0.0, 0)) for i in range(31)])
    before = numbers(localizer)
    assert not feed(localizer, ("magnets", 1_950 * MS, (0.0,)))
    assert not feed(localizer, ("odometry", 1_850 * MS, (0.3, 0.0, 0.0, 0)))
    assert localizer.late == 2
    assert numbers(localizer) == before
    assert feed(localizer, ("magnets", 2_050 * MS, (0.0,)))
    assert numbers(localizer) != before


def test_a_reading_ahead_of_the_odometry_waits_for_it() -> None:
    localizer = fed([("odometry", 0, (0.0, 0.0, 0.0, 0)), ("odometry", 50 * MS, (0.004, 0, 0, 0))])
    before = localizer.estimate
    assert localizer.magnets(75 * MS, (0.0,)) is None
    assert localizer.estimate == before
    assert feed(localizer, ("odometry", 100 * MS, (0.008, 0.0, 0.0, 0)))
    estimate = localizer.estimate
    assert estimate is not None
    assert estimate.stamp_ns == 100 * MS
    assert estimate.nis != 0.0


def test_a_motion_is_split_where_the_magnet_was_seen() -> None:
    """The magnet at (55, 0) mm is 80 mm ahead of the axle at x = -25 mm, half-way of the step."""
    params = LocalizerParams(
        initial_pose=(-0.035, 0.0, 0.0), initial_sigma=(0.02, 1e-4), magnet_model="plain"
    )
    localizer = Localizer(params)
    localizer.odometry(0, 0.0, 0.0, 0.0, (1e-8, 0.0, 0.0, 1e-8), 0.0, 0)
    localizer.magnets(100 * MS, (0.0,))
    localizer.odometry(200 * MS, 0.02, 0.0, 0.0, (1e-8, 0.0, 0.0, 1e-8), 0.2, 0)
    estimate = localizer.estimate
    assert estimate is not None
    assert estimate.x == pytest.approx(-0.015, abs=1e-9)
    assert estimate.nis == pytest.approx(0.0, abs=1e-9)


def test_at_one_stamp_the_motion_goes_first() -> None:
    a = fed([("odometry", 0, (0.0, 0, 0, 0))])
    b = fed([("odometry", 0, (0.0, 0, 0, 0))])
    step: Sample = ("odometry", 100 * MS, (0.004, 0.0, 0.0, 0))
    hit: Sample = ("magnets", 100 * MS, (0.01,))
    for sample in (step, hit):
        feed(a, sample)
    for sample in (hit, step):
        feed(b, sample)
    assert numbers(a) == numbers(b)


def test_the_history_stays_short() -> None:
    localizer = Localizer(LocalizerParams())
    for i in range(20_000):  # a flood: 10 kHz
        feed(localizer, ("odometry", i * 100_000, (i * 1e-6, 0.0, 0.0, 0)))
    for i in range(3_000):
        localizer.magnets((20_000 + i) * 100_000, (0.0,))
    assert len(localizer._history._nodes) <= 4096 + 2048 + 1
    assert localizer.refused == 3_000 - 2048


def test_readings_without_any_wheels_fill_no_memory_and_spoil_no_start() -> None:
    localizer = Localizer(LocalizerParams())
    for i in range(5000):
        assert not feed(localizer, ("magnets", 1_000 * MS + i * MS, (0.0,)))
    assert len(localizer._history._nodes) <= 4096
    assert localizer.estimate is None
    assert feed(localizer, ("odometry", 7_000 * MS, (0.0, 0.0, 0.0, 0)))
    fresh = fed([("odometry", 7_000 * MS, (0.0, 0.0, 0.0, 0))])
    assert localizer.estimate == fresh.estimate


@pytest.mark.parametrize("ahead_ns", [-3_600_000 * MS, 3_600_000 * MS])
def test_a_clock_that_jumped_and_came_back_does_not_shut_the_odometry_out(ahead_ns: int) -> None:
    """One stamp an hour off; a second later estimates follow the odometry again."""
    localizer = fed([("odometry", i * 50 * MS, (i * 0.005, 0.0, 0.0, 0)) for i in range(20)])
    feed(localizer, ("odometry", 20 * 50 * MS + ahead_ns, (0.1, 0.0, 0.0, 0)))
    for i in range(21, 60):
        feed(localizer, ("odometry", i * 50 * MS, (i * 0.005, 0.0, 0.0, 0)))
    estimate = localizer.estimate
    assert estimate is not None
    assert estimate.stamp_ns == 59 * 50 * MS
    assert localizer.late > 0
    # the way of the second in which nothing was believed is owned up to, if there was one
    sigma = math.sqrt(estimate.covariance[0])
    assert abs(estimate.x - 59 * 0.005) < 3 * sigma + 0.001


@pytest.mark.parametrize("reach", [None, 0.00825])
def test_late_magnets_lose_nothing_but_the_way_driven_since(reach: float | None) -> None:
    """400 ms late: the pose is that of 400 ms ago without delay, carried on by the odometry."""
    params, wheels, late_by = LocalizerParams(initial_sigma=SIGMA), wheels_with(2e-5), 8
    for seed in range(3):
        robot, odometry = Drive(Random(seed), params, wheels, reach=reach), Odometry(wheels)
        late, fresh = Localizer(params), Localizer(params)
        hits: list[tuple[float, ...]] = []
        told: list[tuple[tuple[float, float, float], Estimate]] = []
        for i in range(120):
            if i > 0:
                robot.go(0.006, 0.012 * math.sin(0.02 * i))
            out = odometry.update(i * 50 * MS, *robot.counts())
            assert out is not None
            at = (out.x, out.y, out.yaw)
            for localizer in (late, fresh):
                localizer.odometry(
                    out.stamp_ns, *at, out.twist_covariance, out.interval, out.resets
                )
            hits.append(robot.laterals())
            fresh.magnets(i * 50 * MS, hits[i])
            estimate = fresh.estimate
            assert estimate is not None
            told.append((at, estimate))
            if i < late_by:
                continue
            late.magnets((i - late_by) * 50 * MS, hits[i - late_by])
            then, before = told[i - late_by]
            way, now = relative(*then, *at), late.estimate
            assert now is not None
            c, s = math.cos(before.yaw), math.sin(before.yaw)
            assert (now.x, now.y) == pytest.approx(
                (
                    before.x + c * way.ahead - s * way.left,
                    before.y + s * way.ahead + c * way.left,
                ),
                abs=1e-9,
            )
