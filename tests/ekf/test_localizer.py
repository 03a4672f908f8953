"""Claims about the localiser: gate, doubt, resets, refusals, restart."""

import dataclasses
import json
import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lodeline.ekf import Estimate, Localizer, LocalizerParams, LocalizerState
from lodeline.keepsake import rebuilt

MS = 1_000_000
NOISE = (1e-4, 0.0, 0.0, 1e-3)
SURE = (0.0, 0.0, 0.0, 0.0)


def started(**params: object) -> Localizer:
    localizer = Localizer(LocalizerParams(**params))  # type: ignore[arg-type]
    localizer.odometry(0, 0.0, 0.0, 0.0, NOISE, 0.0, 0)
    return localizer


def of(localizer: Localizer) -> Estimate:
    estimate = localizer.estimate
    assert estimate is not None
    return estimate


def test_there_is_no_estimate_before_the_first_odometry() -> None:
    localizer = Localizer(LocalizerParams())
    assert localizer.estimate is None
    assert localizer.magnets(0, (0.0,)) is None


def test_the_first_odometry_is_where_the_robot_was_put() -> None:
    localizer = Localizer(LocalizerParams(initial_pose=(1.0, 2.0, 0.5)))
    first = localizer.odometry(7, 100.0, -3.0, 2.0, NOISE, 0.05, 4)
    assert first is not None
    assert (first.stamp_ns, first.x, first.y, first.yaw) == (7, 1.0, 2.0, 0.5)


def test_only_the_way_between_two_odometry_poses_counts() -> None:
    localizer = Localizer(LocalizerParams(initial_pose=(0.0, 0.0, math.pi / 2)))
    localizer.odometry(0, 5.0, 5.0, math.pi, NOISE, 0.05, 0)
    localizer.odometry(50 * MS, 4.9, 5.0, math.pi, NOISE, 0.05, 0)  # 0.1 m ahead
    assert (of(localizer).x, of(localizer).y) == pytest.approx((0.0, 0.1), abs=1e-12)


def test_a_magnet_pulls_the_estimate_to_it_and_shrinks_the_doubt() -> None:
    localizer = started(initial_pose=(-0.025, 0.004, 0.0), initial_sigma=(0.01, 0.001))
    before = of(localizer)
    after = localizer.magnets(0, (0.0,))  # under the middle of the bar: at (55, 0) mm
    assert after is not None
    assert abs(after.y) < 0.0005
    assert after.covariance[4] < 0.2 * before.covariance[4]
    assert after.rejected == 0


def test_a_hit_beyond_the_gate_is_counted_and_moves_nothing() -> None:
    localizer = started(initial_sigma=(0.002, 0.01), initial_pose=(-0.025, 0.022, 0.0))
    before = of(localizer)
    after = localizer.magnets(0, (0.0,))
    assert after is not None
    assert after.nis > 9.21
    assert after.rejected == 1
    assert (after.x, after.y, after.covariance) == (before.x, before.y, before.covariance)


@pytest.mark.parametrize("gate", [9.21, 100.0, 1000.0, 1e6])
def test_with_a_gate_however_wide_a_magnet_still_corrects(gate: float) -> None:
    """At the bar 0.07 rad make 5.6 mm, as 5 mm of place do: a neighbour may just be meant."""
    localizer = started(initial_pose=(-0.025, 0.010, 0.0), initial_sigma=(0.005, 0.07), gate=gate)
    after = localizer.magnets(0, (0.0,))
    assert after is not None
    assert after.nis > 1.0
    assert after.y < 0.008
    assert len(localizer.state.track.mixture) < 5


def readings_until_found(widen_after: int) -> int | None:
    """Put down 24 mm beside where it is said to be; wheels and start claim no doubt."""
    localizer = started(
        initial_sigma=(0.001, 0.001),
        initial_pose=(-0.025, 0.024, 0.0),
        magnet_model="plain",
        widen_after=widen_after,
    )
    true_x, readings = -0.025, 0
    for i in range(1, 200):
        true_x += 0.005
        localizer.odometry(i * 50 * MS, true_x + 0.025, 0.0, 0.0, SURE, 0.05, 0)
        ahead = true_x + 0.08
        closed = abs(ahead - 0.055 * round(ahead / 0.055)) < 0.008
        localizer.magnets(i * 50 * MS, (0.0,) if closed else ())
        readings += closed
        if abs(of(localizer).y) < 0.004:
            return readings
    return None


def test_magnets_are_not_rejected_for_ever() -> None:
    found = readings_until_found(widen_after=5)
    assert found is not None
    assert 5 <= found < 40
    assert readings_until_found(widen_after=1_000_000) is None


def test_a_parked_robot_gets_no_less_sure_and_no_surer_over_a_magnet() -> None:
    localizer = started(initial_pose=(-0.025, 0.0, 0.0))
    localizer.magnets(0, (0.0,))
    once = of(localizer)
    for i in range(1, 400):
        localizer.odometry(i * 50 * MS, 0.0, 0.0, 0.0, SURE, 0.05, 0)
        localizer.magnets(i * 50 * MS, (0.0,))
    parked = of(localizer)
    assert parked.covariance == pytest.approx(once.covariance, rel=0.05, abs=1e-8)
    assert (parked.x, parked.y) == pytest.approx((once.x, once.y), abs=1e-4)


@pytest.mark.parametrize(("sigma", "ambiguous"), [(0.0069, False), (0.0071, True)])
def test_ambiguous_when_three_sigma_of_the_bar_and_its_own_error_reach_half_the_pitch(
    sigma: float, ambiguous: bool
) -> None:
    """(27.5 mm / 3)^2 = (7.0 mm)^2 + (5.9 mm)^2."""
    assert of(started(initial_sigma=(sigma, 0.01))).ambiguous is ambiguous


def test_doubt_about_the_cell_begins_above_the_level_at_which_it_ends() -> None:
    """8.9 mm (99 %) and 7.0 mm (3 sigma): in between nothing changes, up or down."""
    growing, shrinking, told = (
        started(initial_sigma=(0.0069, 0.0)),
        started(initial_sigma=(0.01, 0.0)),
        [],
    )
    for i, more in enumerate((0.005, 0.003), 1):  # to 8.5 and 9.0 mm
        out = growing.odometry(
            i * 50 * MS, 0.0, 0.0, 0.0, (400.0 * more**2, 0.0, 0.0, 0.0), 0.05, 0
        )
        told.append(out is not None and out.ambiguous)
    assert told == [False, True]
    told = [of(shrinking).ambiguous]
    for i in (1, 2):  # to 7.7 and 6.5 mm
        shrinking.odometry(i * 50 * MS, 0.0, 0.0, 0.0, SURE, 0.05, 0)
        shrinking.position(i * 50 * MS, 0.0, 0.0, 0.012)
        told.append(of(shrinking).ambiguous)
    assert told == [True, True, False]


def test_a_robot_that_starts_with_the_usual_doubt_meets_its_first_magnet_without_an_alarm() -> None:
    """From (0, 0) it is 24 mm to the first reed that closes; the heading is known to 0.05 rad."""
    localizer = started()
    for i in range(1, 13):
        localizer.odometry(i * 10 * MS, i * 0.002, 0.0, 0.0, (0.003, 0.0, 0.0, 1.0), 0.01, 0)
        assert not of(localizer).ambiguous


@pytest.mark.parametrize("announced", [True, False])
def test_over_a_jump_of_the_odometry_the_robot_is_taken_to_go_on_as_it_went(
    announced: bool,
) -> None:
    """At 0.2 m/s and 0.05 s: 10 mm on; that it stopped instead is one sigma off."""
    localizer = started()
    localizer.odometry(50 * MS, 0.01, 0.0, 0.0, NOISE, 0.05, 0)
    before = of(localizer)
    jumped = localizer.odometry(100 * MS, 3.0, -2.0, 1.0, NOISE, 0.05, 1 if announced else 0)
    assert jumped is not None
    assert (jumped.x, jumped.y, jumped.yaw) == pytest.approx((before.x + 0.01, before.y, 0.0))
    assert jumped.covariance[0] == pytest.approx(before.covariance[0] + 0.015**2 + 0.01**2)
    assert jumped.covariance[8] == pytest.approx(before.covariance[8] + 0.1**2)
    resets = 1 if announced else 0
    localizer.odometry(
        150 * MS, 3.0 + 0.01 * math.cos(1), -2.0 + 0.01 * math.sin(1), 1.0, NOISE, 0.05, resets
    )
    assert of(localizer).x == pytest.approx(before.x + 0.02, abs=1e-9)


def test_a_long_gap_is_not_driven_through_blindly() -> None:
    """One second of it; the doubt is the whole way that it may have gone."""
    localizer = started()
    localizer.odometry(50 * MS, 0.01, 0.0, 0.0, NOISE, 0.05, 0)
    localizer.odometry(10_050 * MS, 0.0, 0.0, 0.0, NOISE, 0.0, 1)
    assert of(localizer).x == pytest.approx(0.01 + 0.2, abs=1e-6)
    assert of(localizer).covariance[0] == pytest.approx(2.0**2, rel=0.01)


def test_a_step_over_a_new_reference_is_not_believed_however_small() -> None:
    localizer = started()
    jumped = localizer.odometry(50 * MS, 0.01, 0.0, 0.0, NOISE, 0.05, 1)
    assert jumped is not None
    assert jumped.x == 0.0  # it stood before
    assert jumped.ambiguous


def test_the_doubt_of_a_gap_is_white_in_time() -> None:
    """One lost sample or none: the same doubt, from the sample's own twist covariance."""
    dense, gappy = started(), started()
    for i in range(1, 5):
        dense.odometry(i * 50 * MS, i * 1e-9, 0.0, 0.0, NOISE, 0.05, 0)
    gappy.odometry(50 * MS, 1e-9, 0.0, 0.0, NOISE, 0.05, 0)
    gappy.odometry(200 * MS, 4e-9, 0.0, 0.0, NOISE, 0.05, 0)
    assert of(gappy).covariance == pytest.approx(of(dense).covariance, rel=1e-6, abs=1e-12)


def test_the_alpha_form_adds_the_same_per_step() -> None:
    localizer = started(process_noise="alpha", alpha_sigma=(0.001, 0.01), initial_sigma=(0.0, 0.0))
    for i in range(1, 5):
        localizer.odometry(i * 50 * MS, 0.0, 0.0, 0.0, NOISE, 0.05, 0)
    expected = (4e-6, 0, 0, 0, 4e-6, 0, 0, 0, 4e-4)
    assert of(localizer).covariance == pytest.approx(expected, abs=1e-12)


BAD = [float("nan"), float("inf"), -float("inf"), 1e300]


@pytest.mark.parametrize("bad", BAD)
def test_what_is_not_finite_or_absurd_is_refused_and_counted(bad: float) -> None:
    localizer = started()
    before = of(localizer)
    poses = [(bad, 0.0, 0.0), (0.0, bad, 0.0), (0.0, 0.0, bad)]
    for pose in poses:
        assert localizer.odometry(50 * MS, *pose, NOISE, 0.05, 0) is None
    for covariance in ((bad, 0.0, 0.0, 1.0), (1.0, bad, bad, 1.0), (1.0, 0.0, 0.0, bad)):
        assert localizer.odometry(50 * MS, 0.0, 0.0, 0.0, covariance, 0.05, 0) is None
    assert localizer.odometry(50 * MS, 0.0, 0.0, 0.0, NOISE, bad, 0) is None
    assert localizer.magnets(0, (0.01, bad)) is None
    assert localizer.refused == 8
    assert of(localizer) == before


def test_a_covariance_that_is_none_is_refused() -> None:
    localizer = started()
    for wrong in ((-1.0, 0.0, 0.0, 1.0), (1.0, 2.0, 2.0, 1.0), (1.0, 0.5, -0.5, 1.0)):
        assert localizer.odometry(50 * MS, 0.0, 0.0, 0.0, wrong, 0.05, 0) is None
    assert localizer.refused == 3


numbers = st.floats(allow_nan=True, allow_infinity=True)
wild = st.one_of(st.floats(-1, 1), st.floats(-1e6, 1e6), numbers)
stamps = st.one_of(st.integers(0, 3_000 * MS), st.integers(-(2**63), 2**63 - 1))


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.tuples(stamps, st.tuples(*[wild] * 8), st.integers(0, 2)),
            st.tuples(stamps, st.lists(wild, max_size=4)),
        ),
        max_size=30,
    ),
    st.sampled_from([1e-9, 1e-5, 1e-3, 2e-2]),
)
def test_nothing_that_leaves_is_not_finite_or_not_a_covariance(
    samples: list[tuple[object, ...]], sigma: float
) -> None:
    localizer = Localizer(LocalizerParams(edge_sigma=sigma, lateral_sigma=sigma))
    for sample in samples:
        if len(sample) == 3:
            stamp, (x, y, yaw, vv, vw, ww, interval, _), resets = sample  # type: ignore[misc]
            out = localizer.odometry(stamp, x, y, yaw, (vv, vw, vw, ww), interval, resets)  # type: ignore[arg-type, has-type]
        else:
            out = localizer.magnets(sample[0], tuple(sample[1]))  # type: ignore[arg-type]
        if out is not None:
            assert all(map(math.isfinite, (out.x, out.y, out.yaw, out.nis, *out.covariance)))
            assert -math.pi < out.yaw <= math.pi
            p = np.array(out.covariance).reshape(3, 3)
            assert np.array_equal(p, p.T)
            assert np.linalg.eigvalsh(p)[0] >= -1e-12 * np.trace(p)


def test_a_restored_localizer_goes_on_as_if_nothing_had_been() -> None:
    def sample(localizer: Localizer, i: int) -> None:
        localizer.odometry(i * 50 * MS, i * 0.004, 0.0, 0.01 * i, NOISE, 0.05, 0)
        localizer.magnets(i * 50 * MS, (0.01,) if i % 4 == 0 else ())

    whole, first = started(), started()
    for i in range(1, 60):
        sample(whole, i)
        if i < 30:
            sample(first, i)
    # through JSON and back: lists for tuples
    saved = rebuilt(json.loads(json.dumps(dataclasses.asdict(first.state))), LocalizerState)
    second = Localizer(LocalizerParams())
    second.resume(saved)
    for i in range(30, 60):
        sample(second, i)
    assert of(second) == of(whole)


def test_a_restored_localizer_may_be_less_sure() -> None:
    localizer, other = started(), Localizer(LocalizerParams())
    other.resume(localizer.state, widen=(0.02, 0.1))
    assert of(other).covariance[0] == pytest.approx(of(localizer).covariance[0] + 4e-4)
    assert of(other).covariance[8] == pytest.approx(of(localizer).covariance[8] + 1e-2)


def test_a_saved_state_that_is_broken_is_refused() -> None:
    state = started().state
    track = state.track.each(lambda belief: belief._replace(x=float("nan")))
    broken = dataclasses.replace(state, track=track)
    with pytest.raises(ValueError, match="not finite"):
        Localizer(LocalizerParams()).resume(broken)


@pytest.mark.parametrize(
    "wrong",
    [
        {"lattice_pitch": 0.0},
        {"passage": -0.01},
        {"lateral_sigma": 0.0},
        {"lateral_sigma": 0.03},
        {"sure": 1.0},
        {"widen_after": 0},
        {"widen_sigma": (0.0, 0.1)},
        {"initial_sigma": (-1.0, 0.1)},
    ],
)
def test_parameters_that_make_no_sense_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="must"):
        LocalizerParams(**wrong)  # type: ignore[arg-type]


def test_both_engines_give_the_same_run() -> None:
    rng = Random(11)
    scalar, filterpy = started(), started(engine="filterpy")
    x = yaw = 0.0
    for i in range(1, 300):
        x, yaw = x + rng.uniform(0, 0.006), yaw + rng.uniform(-0.05, 0.05)
        closed = rng.random() < 0.3
        for localizer in (scalar, filterpy):
            localizer.odometry(i * 50 * MS, x, 0.0, yaw, NOISE, 0.05, 0)
            localizer.magnets(i * 50 * MS, (0.01,) if closed else ())
    a, b = of(scalar), of(filterpy)
    assert (a.x, a.y, a.yaw, *a.covariance) == pytest.approx(
        (b.x, b.y, b.yaw, *b.covariance), abs=1e-9
    )
    assert (a.rejected, a.ambiguous) == (b.rejected, b.ambiguous)
