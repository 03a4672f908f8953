"""Claims about magnets that look alike: the robot is never sure of a wrong one of them."""

import dataclasses
import json
import math
from random import Random

import pytest

from lodeline.bench.scenes.drive import Drive
from lodeline.bench.scenes.rides import SIGMA, ride, wheels_with
from lodeline.ekf import Belief, Estimate, Localizer, LocalizerParams, LocalizerState
from lodeline.ekf.mixture import MOST, Hypothesis, certainty, reduced, spread
from lodeline.keepsake import rebuilt
from lodeline.odometry import Odometry, OdometryParams

MS = 1_000_000
PITCH = 0.055
STILL = (0.0, 0.0, 0.0, 0.0)


def test_after_600_mm_without_magnets_few_runs_are_wrong_and_none_is_wrong_and_sure() -> None:
    """The nearest magnet is the wrong one in more than a tenth of the same runs."""
    wheels, runs = wheels_with(2.3e-5), 60
    wrong: dict[str, int] = {}
    for association in ("nearest", "mixture"):
        params = LocalizerParams(initial_sigma=SIGMA, association=association)
        ends = [[*ride(seed, params, wheels, 1.5, hidden=(0.3, 0.9))][-1] for seed in range(runs)]
        aliased = [estimate for _, error, estimate in ends if error > 0.5 * PITCH]
        wrong[association] = len(aliased)
        sure = sum(not each.ambiguous for each in aliased)
        print(f"{association}: {len(aliased)} of {runs} aliased, {sure} of these sure")
        if association == "mixture":
            assert len(aliased) <= 0.05 * runs
            assert sure <= 0.02 * runs
            assert sum(each.ambiguous for _, _, each in ends) <= 0.15 * runs
    assert wrong["nearest"] >= 0.10 * runs


@pytest.mark.parametrize("noise", [2.3e-5, 1e-4])
def test_of_all_poses_that_claim_to_be_sure_no_more_than_one_in_twenty_is_wrong(
    noise: float,
) -> None:
    """The second robot has four times the noise: half of its neighbours are in the ellipse."""
    params = LocalizerParams(initial_sigma=SIGMA)
    sure = wrong = 0
    for seed in range(60):
        for way, error, estimate in ride(seed, params, wheels_with(noise), 1.5, hidden=(0.3, 0.9)):
            if way >= 0.9 and not estimate.ambiguous:
                sure, wrong = sure + 1, wrong + (error > 0.5 * PITCH)
    print(f"noise {noise} m: {wrong} of {sure} sure poses are wrong")
    assert sure > 1200
    assert wrong <= 0.05 * sure


def test_a_run_that_ends_in_a_wrong_cell_was_ambiguous_before() -> None:
    """Odometry noise three times as large as the filter is told (S17)."""
    params, told, true = LocalizerParams(initial_sigma=SIGMA), wheels_with(2e-5), wheels_with(6e-5)
    aliased = warned = 0
    for seed in range(60):
        seen = localised_with(seed, params, told, true, 0.5)
        wrong_from = next((i for i, (error, _) in enumerate(seen) if error > 0.5 * PITCH), None)
        if wrong_from is not None:
            aliased += 1
            warned += any(estimate.ambiguous for _, estimate in seen[: wrong_from + 1])
    print(f"{warned} of {aliased} runs that left their cell were ambiguous before")
    assert aliased >= 10
    assert warned >= 0.95 * aliased


def localised_with(
    seed: int, params: LocalizerParams, told: OdometryParams, true: OdometryParams, gap: float
) -> list[tuple[float, Estimate]]:
    """(error, estimate) of a robot whose wheels are not those that odometry is told."""
    rng, step = Random(seed), 0.006
    drive, odometry, localizer = Drive(rng, params, true), Odometry(told), Localizer(params)
    seen = []
    for i in range(round((0.3 + gap + 0.6) / step)):
        if i > 0:
            drive.go(step, 0.0)
        out = odometry.update(i * 50 * MS, *drive.counts())
        assert out is not None
        pose = (out.x, out.y, out.yaw)
        localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
        localizer.magnets(out.stamp_ns, () if 0.3 <= i * step < 0.3 + gap else drive.laterals())
        estimate = localizer.estimate
        assert estimate is not None
        seen.append((math.hypot(estimate.x - drive.x, estimate.y - drive.y), estimate))
    return seen


def after_a_reset(seed: int, blind: float, stops: bool) -> list[tuple[float, Estimate]]:
    """(error, estimate) at 50 Hz after the encoders' driver was dead for `blind` s, then began anew

    The robot drives on meanwhile, or it stops at once and goes on later.
    """
    params = LocalizerParams(initial_sigma=SIGMA)
    wheels = OdometryParams(ticks_per_turn=16384, distance_noise=2e-5)
    rng = Random(seed)
    drive, odometry, localizer = Drive(rng, params, wheels), Odometry(wheels), Localizer(params)
    dead = 200 + rng.randrange(50)
    alive, zero, seen = dead + round(blind / 0.02), (0, 0), []
    for i in range(500):
        way = 0.0 if stops and dead <= i < alive else 0.0024
        drive.go(way, way / 0.2 if i // 150 % 2 else 0.0)
        localizer.magnets(i * 20 * MS, drive.laterals())
        if dead <= i < alive:
            continue
        if i == alive:
            zero = drive.counts()
        left, right = drive.counts()
        out = odometry.update(i * 20 * MS, left - zero[0], right - zero[1])
        assert out is not None
        pose = (out.x, out.y, out.yaw)
        localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
        estimate = localizer.estimate
        assert estimate is not None
        if i >= alive:
            seen.append((math.hypot(estimate.x - drive.x, estimate.y - drive.y), estimate))
    assert odometry.state.resets == 1
    return seen


@pytest.mark.parametrize("stops", [False, True])
@pytest.mark.parametrize("blind", [0.1, 0.3, 0.6])
def test_after_the_encoders_began_anew_no_pose_is_sure_and_one_pitch_off(
    blind: float, stops: bool
) -> None:
    runs = [after_a_reset(seed, blind, stops) for seed in range(12)]
    assert all(run[0][1].ambiguous for run in runs)
    wrong = [each for run in runs for error, each in run if error > 0.5 * PITCH]
    assert not [each for each in wrong if not each.ambiguous]
    if not stops and blind < 0.5:  # the guess that it went on is good
        assert sum(run[-1][0] < 0.010 for run in runs) >= 11


def test_a_parked_robot_stays_sure_when_its_encoders_begin_anew() -> None:
    """Nothing it did before says that it went anywhere."""
    localizer = Localizer(LocalizerParams(initial_pose=(-0.025, 0.0, 0.0), initial_sigma=SIGMA))
    for i in range(20):
        localizer.odometry(i * 50 * MS, 0.0, 0.0, 0.0, STILL, 0.05, 0)
        localizer.magnets(i * 50 * MS, (0.0,))
    localizer.odometry(1_300 * MS, 0.0, 0.0, 0.0, STILL, 0.0, 1)
    doubtful = localizer.estimate
    localizer.magnets(1_300 * MS, (0.0,))
    found = localizer.estimate
    assert doubtful is not None
    assert doubtful.ambiguous
    assert found is not None
    assert not found.ambiguous
    assert abs(found.x + 0.025) < 0.003


def torn_apart() -> Localizer:
    """Put down with 30 mm of doubt, and over a magnet."""
    params = LocalizerParams(initial_pose=(-0.020, 0.0, 0.0), initial_sigma=(0.030, 0.05))
    localizer = Localizer(params)
    localizer.odometry(0, 0.0, 0.0, 0.0, STILL, 0.0, 0)
    localizer.magnets(0, (0.0,))
    return localizer


def test_a_magnet_that_may_be_many_makes_one_hypothesis_for_each() -> None:
    localizer = torn_apart()
    (leading, *others), estimate = localizer.state.track.mixture, localizer.estimate
    assert estimate is not None
    assert estimate.ambiguous
    assert 0.3 < estimate.certainty < 0.9
    places = sorted((round(x / PITCH), round(y / PITCH)) for _, (x, y, *_) in others)
    for neighbour in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        assert neighbour in places
    assert sum(weight for weight, _ in others) + leading.weight == pytest.approx(1.0)
    # the ellipse that is told covers the neighbours, not only the leading hypothesis
    assert estimate.covariance[0] > 10 * leading.belief.p00
    assert math.sqrt(estimate.covariance[0]) > 0.02


def test_a_mixture_outlives_a_restart() -> None:
    whole, first = torn_apart(), torn_apart()
    saved = rebuilt(json.loads(json.dumps(dataclasses.asdict(first.state))), LocalizerState)
    second = Localizer(LocalizerParams())
    second.resume(saved)
    for i in range(1, 40):
        for localizer in (whole, second):
            localizer.odometry(i * 50 * MS, i * 0.004, 0.0, 0.0, STILL, 0.05, 0)
            localizer.magnets(i * 50 * MS, (0.0,) if i % 14 < 4 else ())
    assert len(whole.state.track.mixture) > 3
    assert second.state == whole.state


def test_a_saved_hypothesis_that_is_broken_is_refused() -> None:
    state = torn_apart().state
    leading, other, *_ = state.track.mixture
    broken = state.track._replace(mixture=(leading, other._replace(weight=math.nan)))
    with pytest.raises(ValueError, match="not finite"):
        Localizer(LocalizerParams()).resume(dataclasses.replace(state, track=broken))


def at(x: float, weight: float = 1.0, sigma: float = 0.003) -> Hypothesis:
    return Hypothesis(weight, Belief(x, 0.0, 0.0, sigma**2, 0.0, 0.0, sigma**2, 0.0, 0.01))


def test_hypotheses_closer_than_4_mm_are_one_with_the_moments_of_both() -> None:
    (one,) = reduced([at(0.0, 3.0), at(0.002, 1.0)])
    assert one.weight == 1.0
    assert one.belief.x == pytest.approx(0.0005)
    assert one.belief.p00 == pytest.approx(0.003**2 + 3 / 16 * 0.002**2)
    assert len(reduced([at(0.0), at(0.0045)])) == 2


def test_unlikely_hypotheses_go_and_no_more_than_40_stay() -> None:
    assert [each.weight for each in reduced([at(0.0), at(0.055, 0.9e-4)])] == [1.0]
    many = reduced([at(0.01 * i, 1.0 + i) for i in range(60)])
    assert len(many) == MOST
    assert many[0].belief.x == pytest.approx(0.59)
    assert sum(each.weight for each in many) == pytest.approx(1.0)


def test_certainty_is_the_weight_of_the_cell_and_the_spread_covers_the_others() -> None:
    mixture = reduced([at(0.0, 0.6), at(0.006, 0.1), at(0.055, 0.3)])
    assert certainty(mixture, PITCH) == pytest.approx(0.7)
    told = spread(mixture)
    assert told.x == 0.0
    assert told.p00 == pytest.approx(0.003**2 + 0.1 * 0.006**2 + 0.3 * 0.055**2)


def test_a_robot_that_may_be_anywhere_is_told_nothing_by_a_magnet() -> None:
    localizer = Localizer(LocalizerParams(initial_sigma=(0.5, 0.5)))
    before = localizer.odometry(0, 0.0, 0.0, 0.0, STILL, 0.0, 0)
    after = localizer.magnets(0, (0.0,))
    assert before is not None
    assert after is not None
    assert after.ambiguous
    assert after.covariance == before.covariance
