"""Every sample of the FIFO comes out, with the time at which the chip took it."""

from __future__ import annotations

import random
from itertools import pairwise
from math import atan2, cos, pi, sin
from typing import Literal

import pytest

from lodeline.devices import ImuBoard, MpuFifo, MpuParams, check_rate
from lodeline.devices.sample_clock import SampleClock
from tests.devices.rig import MakeRig, Rig

HAND = 0.2  # s: what the gyro feels goes round as the hand of a clock does
LENGTH = 8.0  # rad/s, so that a bit of it is a microsecond


def hand(t: float) -> tuple[float, float, float]:
    return LENGTH * cos(2.0 * pi * t / HAND), LENGTH * sin(2.0 * pi * t / HAND), 0.1


def told(stamp: float, rate: tuple[float, float, float]) -> float:
    """When a rate was felt [s], known to be about at the stamp."""
    since = atan2(rate[1], rate[0]) / (2.0 * pi) * HAND
    return since + HAND * round((stamp - since) / HAND)


class Stage:
    """A board read through its FIFO, with ticks as uneven as a busy machine makes them."""

    def __init__(
        self, bench: Rig, sample_rate: float, tick_rate: float, dlpf: Literal[1, 2, 5] = 2
    ) -> None:
        self.bench = bench
        self.chip = bench.robot.imu
        self.chip._angular_velocity = hand
        self.chip._specific_force = lambda t: (0.3 * sin(9e4 * t), 0.0, 9.8 + 0.3 * sin(2e5 * t))
        params = MpuParams(sample_rate=sample_rate, fifo=True, dlpf=dlpf)
        self.board = ImuBoard(bench.bus, bench.clock, params)
        self.period = 1.0 / sample_rate
        self.tick_rate = tick_rate
        self.dice = random.Random(7)
        self.late: list[float] = []
        bench.latency = 0.15e-3  # s: 45 bits of 400 kHz, and the system call

    def run(self, seconds: float) -> list[tuple[float, float]]:
        """Samples of some seconds: (stamp [s], when the gyro felt it [s])."""
        bench, begin, got = self.bench, self.bench.now, []
        for i in range(1, round(seconds * self.tick_rate) + 1):
            late = min(self.dice.expovariate(1.0 / 60e-6), 5e-3)
            bench.now = max(bench.now, begin + i / self.tick_rate + late)
            samples, _ = self.board.read(round(bench.now * 1e9))
            got += [(s * 1e-9, told(s * 1e-9, r.angular_velocity)) for s, r in samples]
        return got


def errors(got: list[tuple[float, float]], period: float) -> list[float]:
    """Stamps less truth, in samples."""
    return [(stamp - true) / period for stamp, true in got]


@pytest.mark.parametrize("error", [-0.02, -0.003, 0.0, 0.0001, 0.01, 0.02])
@pytest.mark.parametrize("chip", ["mpu9250", "mpu6050"])
@pytest.mark.parametrize(("sample_rate", "tick_rate"), [(1000.0, 100.0), (500.0, 50.0)])
def test_stamps_are_right_to_a_fifth_of_a_sample_from_the_first_one_on(
    rig: MakeRig, chip: str, sample_rate: float, tick_rate: float, error: float
) -> None:
    """Whether the chip's clock slides past ours or keeps step with it, and through the filter."""
    dlpf: Literal[1, 5] = 1 if chip == "mpu9250" else 5
    stage = Stage(rig(imu_clock_error=error, imu_chip=chip), sample_rate, tick_rate, dlpf)
    got = stage.run(0.6)
    first = got[0][1]
    assert first < 0.26, "it takes 0.17 s until the gyro has started"
    got += stage.run(0.9)
    assert len(got) == pytest.approx((1.5 - first) * sample_rate * (1.0 + error), abs=22)
    assert all(after > before for (before, _), (after, _) in pairwise(got))
    assert max(map(abs, errors(got, stage.period))) < 0.2
    assert stage.board.health.state in ("ok", "degraded")


def test_stamps_are_right_to_a_fifth_of_a_sample_for_any_clock() -> None:
    """The arithmetic alone, over clocks that no chip of the simulator has: drifting ones."""
    for seed in range(20):
        dice = random.Random(seed)
        off, phase = dice.uniform(-0.02, 0.02), dice.random()
        period = 0.001

        def taken(k: float, off: float = off, phase: float = phase) -> float:
            # a clock that drifts by 0.01 % and back within a minute
            t = (k + phase) * 0.001 / (1.0 + off)
            return t + 1e-4 * 60.0 / (2.0 * pi) * sin(2.0 * pi * t / 60.0)

        clock, seen, worst = SampleClock(period), 0, 0.0
        for tick in range(1, 1500):
            before = 0.01 * tick + dice.expovariate(1.0 / 60e-6)
            at, after = before + dice.uniform(20e-6, 100e-6), before + 120e-6
            count = seen
            while taken(count + 1) <= at:
                count += 1
            clock.update(before, after, count - seen)
            seen = count
            if tick > 300:
                newest, off = clock.taken()
                worst = max(worst, abs(newest - taken(count)) / period)
                assert abs(newest - taken(count)) <= off + 2e-6
        assert worst < 0.2, seed
        now = taken(seen) - taken(seen - 1)
        assert abs(clock.period - now) < 3e-4 * period, "or the oldest of a batch would be off"


def test_on_a_bus_too_slow_to_tell_samples_go_out_and_the_state_is_degraded(rig: MakeRig) -> None:
    stage = Stage(rig(imu_clock_error=0.0), 1000.0, 100.0)
    stage.bench.latency = 0.7e-3
    stage.run(0.6)
    got = stage.run(2.0)
    assert len(got) > 1500
    health = stage.board.health
    assert health.state == "degraded"
    assert health.message.startswith("FIFO_TIMES imu: times are off by up to 0.")
    assert max(map(abs, errors(got, stage.period))) < 0.7


def test_a_fifo_that_stays_empty_is_told_within_150_ms(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Stage(rig(), 1000.0, 100.0)
    stage.run(1.0)
    monkeypatch.setattr(stage.chip, "_push", lambda frame: None)
    assert all(abs(s - t) < 2e-4 for s, t in stage.run(0.15)), "what was in it"
    stuck = stage.board.health
    assert stuck.state == "fault"
    assert stuck.message.startswith("IMU_STUCK imu: no new sample for 0.1")
    monkeypatch.undo()
    assert max(map(abs, errors(stage.run(1.0), stage.period))) < 0.2
    assert stage.board.health.state == "ok"


def test_a_look_that_comes_too_late_loses_samples_and_says_how_many(rig: MakeRig) -> None:
    stage = Stage(rig(), 1000.0, 100.0)
    stage.run(3.0)
    before = stage.bench.now
    stage.bench.now += 0.2
    got = stage.run(2.0)
    mpu = stage.board.mpu
    assert isinstance(mpu, MpuFifo)
    lost = round((got[0][0] - before) / stage.period)
    assert mpu.health.message == f"FIFO_OVERFLOW imu: read too late, {mpu.lost} samples lost"
    assert mpu.lost == pytest.approx(lost, abs=20)
    assert got[0][0] - (before + 0.2) < 0.02, "on again with the next look"
    assert max(map(abs, errors(got, stage.period))) < 0.2, "the chip's rate was not forgotten"
    assert stage.board.health.state == "ok"


def test_a_nack_costs_nothing_and_a_torn_read_never_shifts_a_frame(rig: MakeRig) -> None:
    stage = Stage(rig(), 1000.0, 100.0)
    stage.run(2.0)
    dice = random.Random(3)
    stage.bench.fail = lambda address: 121 if address == 0x68 and dice.random() < 0.03 else 0
    got = stage.run(2.0)
    assert len(got) == pytest.approx(2006, abs=12)
    stage.bench.fail = lambda address: 5 if address == 0x68 and dice.random() < 0.03 else 0
    got = stage.run(5.0)
    stage.bench.fail = lambda address: 0
    mpu = stage.board.mpu
    assert isinstance(mpu, MpuFifo)
    assert mpu.lost > 0
    assert len(got) + mpu.lost == pytest.approx(5015, rel=0.02)
    assert all(abs(s - t) < 0.01 for s, t in got), "a shifted frame would feel anything"


def test_a_reset_in_flight_lets_no_sample_out_until_all_is_set_again(rig: MakeRig) -> None:
    stage = Stage(rig(), 1000.0, 100.0)
    stage.run(2.0)
    stage.chip.reset()
    at = stage.bench.now
    got = stage.run(1.0)
    assert all(abs(s - t) < 0.01 for s, t in got)
    assert got[0][0] - at < 0.3
    assert "IMU_RESET imu" in stage.board.mpu.health.message


def test_samples_come_out_at_the_rate_of_the_chip_and_cost_three_transactions_a_look(
    rig: MakeRig,
) -> None:
    stage = Stage(rig(imu_chip="mpu6500"), 500.0, 50.0)
    stage.run(1.0)
    before = stage.bench.transactions
    got = stage.run(2.0)
    assert len(got) == pytest.approx(1003, abs=12)
    assert stage.bench.transactions - before <= 3 * 100 + 3 * 21


def test_a_rate_that_overflows_the_fifo_or_reads_samples_twice_is_refused() -> None:
    params = MpuParams(sample_rate=1000.0, fifo=True)
    with pytest.raises(ValueError, match="needs a rate of 55 Hz or more"):
        check_rate(params, 50.0)
    check_rate(params, 55.0)
    check_rate(MpuParams(sample_rate=1000.0), 1.0)
    with pytest.raises(ValueError, match="must not be above the sample_rate of 100 Hz, got 200"):
        check_rate(MpuParams(sample_rate=100.0), 200.0)
