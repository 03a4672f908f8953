"""The encoders' driver: cumulative counts that never jump."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.devices.as5048b import Encoders, EncodersParams
from lodeline.devices.counter import TURN, Counter
from lodeline.odometry import Odometry, OdometryEstimate, OdometryParams
from tests.devices.rig import MakeRig

PER_RADIAN = TURN / (2.0 * pi)


@given(
    start=st.integers(0, TURN - 1),
    steps=st.lists(st.integers(-TURN // 2 + 400, TURN // 2 - 400), max_size=60),
)
def test_the_count_is_the_sum_of_all_steps_over_any_roll_over(start: int, steps: list[int]) -> None:
    counter, angle = Counter(), start
    counter.update(0.0, angle)
    # in one instant there is no speed to expect more steps from
    for step in steps:
        angle = (angle + step) % TURN
        assert counter.update(0.0, angle)
    assert counter.count == sum(steps)


@pytest.mark.parametrize("speed", [30000, -30000, 3000, 0])
def test_a_steady_wheel_is_counted_through_roll_overs_and_gaps(speed: int) -> None:
    counter = Counter()
    times = [0.01 * i for i in range(200)] + [2.9 + 0.01 * i for i in range(100)]  # gap: 0.91 s
    for now in times:
        assert counter.update(now, round(speed * now) % TURN)
    assert counter.count == pytest.approx(speed * times[-1], abs=1)


@pytest.mark.parametrize("end", [1.3, 1.5, 1.9])
@pytest.mark.parametrize("change", [6000.0, -9000.0, 40_000.0, -70_000.0])
def test_over_a_gap_in_which_the_wheel_changes_its_speed_no_turn_is_lost_in_silence(
    end: float, change: float
) -> None:
    """A wheel at 2 turns/s speeds up or brakes (counts/s^2) while nobody reads it."""

    def way(now: float) -> float:
        return (
            30_000.0 * now
            + 0.5 * change * min(max(now - 1.0, 0.0), end - 1.0) ** 2
            + (change * (end - 1.0) * max(now - end, 0.0))
        )

    counter = Counter()
    for i in range(101):
        assert counter.update(0.01 * i, round(way(0.01 * i)) % TURN)
    assert counter.update(end, round(way(end)) % TURN)
    assert counter.update(end + 0.01, round(way(end + 0.01)) % TURN)
    assert counter.waiting, "it takes 15 ms to know the speed after the gap"
    honest = counter.update(end + 0.02, round(way(end + 0.02)) % TURN)
    if abs(change) * (end - 1.0) ** 2 < 0.4 * TURN:
        assert honest
    if honest:
        assert counter.count == pytest.approx(way(end + 0.02), abs=2)
    else:
        assert (counter.count, counter.why) == (0, "speed changed while silent")


@pytest.mark.parametrize("late", [0.007, -0.007])
def test_a_reading_that_is_late_on_a_busy_machine_is_no_change_of_speed(late: float) -> None:
    """The stamp is that of the tick: the first reading after the gap was made 7 ms off it."""
    counter = Counter()
    times = [0.01 * i for i in range(100)] + [1.89 + 0.01 * i for i in range(20)]
    for now in times:
        moment = now + (late if now == 1.89 else 0.0)
        assert counter.update(now, round(14_500 * moment) % TURN), counter.why
    assert counter.count == pytest.approx(14_500 * times[-1], abs=1)


def test_after_a_longer_gap_the_count_starts_from_zero() -> None:
    counter = Counter()
    for i in range(100):
        counter.update(0.01 * i, 100 * i)
    assert counter.count == 9900
    assert not counter.update(2.5, 5000)
    assert counter.count == 0
    assert counter.update(2.51, 5010)
    assert counter.count == 10


def test_counts_follow_the_wheels_both_ways_without_a_jump(rig: MakeRig) -> None:
    bench = rig(encoder_noise=0.0)
    encoders = Encoders(bench.bus)
    encoders.read(0.0)

    def read(now: float) -> tuple[tuple[int, int] | None, float, float]:
        bench.robot.command(0.4 if now < 4.0 else -0.4, 0.5)
        counts = encoders.read(now)
        state = bench.robot.state
        return counts, state.left_angle, state.right_angle

    last = (0, 0)
    for _, (counts, left, right) in bench.run(8.0, 100.0, read):
        assert counts is not None
        assert abs(counts[0] - last[0]) < 1000
        assert abs(counts[1] - last[1]) < 1000
        assert counts == pytest.approx((left * PER_RADIAN, right * PER_RADIAN), abs=2)
        last = counts
    assert bench.robot.state.left_angle < 20.0, "it went forward and came back"


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_inverted_encoder_counts_forward_all_the_same(rig: MakeRig, side: str) -> None:
    bench = rig(**{f"{side}_inverted": True})
    encoders = Encoders(bench.bus, EncodersParams(**{f"{side}_inverted": True}))
    counts = bench.run(3.0, 100.0, encoders.read)[-1][1]
    plain = rig()
    reference = plain.run(3.0, 100.0, Encoders(plain.bus).read)[-1][1]
    assert counts == pytest.approx(reference, abs=5)
    assert counts is not None
    assert min(counts) > 10000


def test_a_failed_read_drops_the_sample_and_loses_no_way(rig: MakeRig) -> None:
    bench = rig(encoder_noise=0.0)
    encoders = Encoders(bench.bus)
    encoders.read(0.0)
    bench.run(2.0, 100.0, encoders.read)
    bench.fail = lambda address: 121 if address == 0x41 else 0
    got = bench.run(0.05, 100.0, encoders.read)
    assert [counts for _, counts in got] == [None] * 5
    assert encoders.health.failed == 5
    bench.fail = lambda address: 0
    counts = bench.run(0.01, 100.0, encoders.read)[0][1]
    state = bench.robot.state
    assert counts == pytest.approx(
        (state.left_angle * PER_RADIAN, state.right_angle * PER_RADIAN), abs=2
    )


def test_a_bus_gone_for_a_second_costs_no_way(rig: MakeRig) -> None:
    bench = rig(slip=0.0)
    encoders = Encoders(bench.bus)
    encoders.read(0.0)
    bench.run(2.0, 100.0, encoders.read)
    bench.fail = lambda address: 121
    bench.run(0.5, 100.0, encoders.read)
    assert encoders.health.state == "fault"
    assert encoders.health.message == (
        "I2C_GONE encoders left: no answer at 0x40 on bus model (errno 121) - check cable and power"
    )
    bench.fail = lambda address: 0
    got = bench.run(0.8, 100.0, encoders.read)
    silence = sum(counts is None for _, counts in got) / 100.0
    assert silence < 0.4, "the encoders were tried again before a second was over"
    assert encoders.health.recovered == 2
    state = bench.robot.state
    assert got[-1][1] == pytest.approx(
        (state.left_angle * PER_RADIAN, state.right_angle * PER_RADIAN), abs=2
    )


def test_after_a_long_silence_both_counts_start_from_zero_together(rig: MakeRig) -> None:
    bench = rig()
    encoders = Encoders(bench.bus)
    bench.run(2.0, 100.0, encoders.read)
    bench.fail = lambda address: 121 if address == 0x40 else 0
    bench.run(4.0, 100.0, encoders.read)
    bench.fail = lambda address: 0
    got = [counts for _, counts in bench.run(2.5, 100.0, encoders.read) if counts is not None]
    assert got[0] == (0, 0), "what odometry takes for a new reference"
    assert encoders.health.message.startswith("ENC_GAP encoders left: silent for over 1 s")
    assert all(0 <= b[0] - a[0] < 400 for a, b in pairwise(got))


def test_a_robot_that_turns_round_unseen_is_announced_to_odometry_not_guessed(
    rig: MakeRig,
) -> None:
    bench = rig(slip=0.0)
    encoders = Encoders(bench.bus)
    odometry = Odometry(OdometryParams(ticks_per_turn=TURN))

    def read(now: float) -> OdometryEstimate | None:
        bench.robot.command(0.4 if now < 2.0 else -0.4, 0.0)
        counts = encoders.read(now)
        return odometry.update(round(now * 1e9), *counts) if counts else None

    before = [each for _, each in bench.run(2.0, 100.0, read) if each][-1]
    bench.robot.command(-0.4, 0.0)
    bench.now += 0.5  # in which this process was not given the processor
    after = [each for _, each in bench.run(3.0, 100.0, read) if each]
    assert (before.resets, before.interval > 0.0) == (0, True)
    assert (after[0].resets, after[0].interval) == (1, 0.0)
    assert (after[0].x, after[0].y) == (before.x, before.y), "the pose stays, and says so"
    assert after[-1].v == pytest.approx(-0.4, abs=0.02)


def test_a_successor_counts_on_as_if_nothing_had_happened(rig: MakeRig) -> None:
    bench = rig(left_inverted=True)
    params = EncodersParams(left_inverted=True)
    whole = Encoders(bench.bus, params)
    assert whole.state is None
    bench.run(2.0, 100.0, whole.read)
    state = whole.state
    assert state is not None
    successor = Encoders(bench.bus, params)
    successor.resume(state)
    bench.now += 0.7  # of silence, more than half a turn
    pairs = bench.run(1.0, 100.0, lambda now: (whole.read(now), successor.read(now)))
    assert all(mine == yours for _, (mine, yours) in pairs)
    true = bench.robot.state.right_angle * PER_RADIAN
    last = pairs[-1][1][1]
    assert last is not None
    assert last[1] == pytest.approx(true, abs=60), "since the first reading, not since power-on"


@pytest.mark.parametrize(
    ("flags", "text", "valid"),
    [
        (0x05, "magnet too near", True),
        (0x09, "magnet too far", True),
        (0x03, "angle not valid", False),
    ],
)
def test_a_badly_seated_magnet_is_told(rig: MakeRig, flags: int, text: str, valid: bool) -> None:
    bench = rig()
    encoders = Encoders(bench.bus)
    bench.run(0.2, 100.0, encoders.read)
    bench.robot.left.flags = flags
    got = bench.run(1.0, 100.0, encoders.read)
    assert encoders.health.message == f"ENC_MAGNET encoders left: {text}"
    assert encoders.health.events == 1, "said once"
    assert (got[-1][1] is not None) is valid
