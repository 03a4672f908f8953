"""Each fault of a board: what goes out meanwhile, what is said, how soon all is well, what is lost.

`pytest tests/devices/test_faults.py -s` prints the figures.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import pytest

from lodeline.devices import Ak8963, Encoders, ImuReading, Mpu, MpuParams, ReedBar
from lodeline.devices.guard import Guard
from lodeline.devices.link import Health
from lodeline.sim.chips.as5048b import TURN
from lodeline.sim.chips.mpu_timing import delays
from tests.devices.ordeal import Outcome, suffer
from tests.devices.rig import MakeRig, Rig

Field = tuple[float, float, float]
RATE = 200.0
PERIOD = 1.0 / RATE


def imu_trial(
    bench: Rig,
    begin: Callable[[Rig], object],
    end: Callable[[Rig], object],
    lasts: float = 1.0,
    params: MpuParams | None = None,
) -> Outcome[ImuReading]:
    """The gyro and accelerometer under a fault; false is what the sensors did not feel."""
    imu = Mpu(bench.bus, params)
    chip = bench.robot.imu
    rate, force = chip._angular_velocity, chip._specific_force

    def true(now: float, got: ImuReading) -> bool:
        gyro_delay, accel_delay = delays(chip._identity, chip._registers)
        felt = (*rate(now - gyro_delay), *force(now - accel_delay))
        said = (*got.angular_velocity, *got.linear_acceleration)
        limits = (0.05,) * 3 + (0.6,) * 3  # a sample ago, other noise: 0.002 rad/s, 0.03 m/s^2
        return all(abs(a - b) < most for a, b, most in zip(felt, said, limits, strict=True))

    out = suffer(
        bench,
        RATE,
        imu.read,
        lambda: imu.health,
        true,
        lambda: begin(bench),
        lambda: end(bench),
        lasts,
    )
    print(f"\n{out}")
    return out


def failing(
    number: int, times: float = float("inf"), latency: float = 0.0
) -> Callable[[Rig], None]:
    """Make that many transactions with the IMU fail, each lasting so long [s]."""

    def begin(bench: Rig) -> None:
        left = times

        def fail(address: int) -> int:
            nonlocal left
            if address != 0x68 or left <= 0:
                return 0
            left -= 1
            return number

        bench.fail, bench.latency = fail, latency

    return begin


def well(bench: Rig) -> None:
    bench.fail, bench.latency = lambda address: 0, 0.0


def nothing(bench: Rig) -> None:
    """The fault is over by itself."""


@pytest.mark.parametrize("number", [121, 6, 5])
def test_one_nack_is_retried_and_costs_nothing(rig: MakeRig, number: int) -> None:
    out = imu_trial(rig(), failing(number, times=1), well)
    assert (out.false, out.lost, out.states) == (0, 0, {"ok"})
    assert out.messages == [f"I2C_NACK imu: 1 read failed (errno {number}), retried"]


def test_a_sensor_that_is_gone_for_3_s_is_back_within_a_second(rig: MakeRig) -> None:
    out = imu_trial(rig(), failing(121), well, lasts=3.0)
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert out.noticed <= 0.06
    assert out.messages[0].startswith("I2C_GONE imu: no answer at 0x68 on bus model (errno 121)")
    assert out.recovered <= 0.75


def test_a_stuck_bus_is_named_and_hardly_holds_the_loop(rig: MakeRig) -> None:
    bench = rig()
    spent: list[float] = []

    def begin(bench: Rig) -> None:
        failing(110, latency=0.05)(bench)
        spent.append(bench.transactions)

    def end(bench: Rig) -> None:
        well(bench)
        spent.append(bench.transactions)

    out = imu_trial(bench, begin, end, lasts=3.0)
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert out.noticed <= 0.02
    assert out.messages[0].startswith("I2C_HANG imu: bus model does not come free")
    assert out.recovered <= 0.75
    assert (spent[1] - spent[0]) * 0.05 <= 0.5, "of 3 s, in which ticks cannot come"


def test_a_bus_that_hangs_is_asked_once_a_tick_however_many_devices_it_has(rig: MakeRig) -> None:
    bench = rig()
    encoders = Encoders(bench.bus)
    bench.run(0.5, 100.0, encoders.read)
    bench.fail = lambda address: 110
    before = bench.transactions
    bench.run(0.1, 100.0, encoders.read)
    assert bench.transactions - before == 3
    assert encoders.health.state == "fault"
    assert encoders.health.message.startswith("I2C_HANG encoders ")


@pytest.mark.parametrize("power", [False, True])
@pytest.mark.parametrize("chip", ["mpu9250", "mpu6050"])
def test_a_chip_that_resets_in_flight_sends_nothing_on_another_scale(
    rig: MakeRig, chip: str, power: bool
) -> None:
    bench = rig(imu_chip=chip)
    reset = bench.robot.imu.power_cycle if power else bench.robot.imu.reset
    out = imu_trial(bench, lambda _: reset(), nothing, params=MpuParams(accel_range=16))
    assert (out.false, out.after) == (0, "ok")
    assert out.noticed <= 0.025
    assert "IMU_RESET imu: registers lost, reconfigured" in out.messages
    assert out.lost * PERIOD <= 0.2


def test_a_chip_swapped_in_flight_sends_nothing_and_is_named(rig: MakeRig) -> None:
    def swap(identity: int) -> Callable[[Rig], None]:
        def do(bench: Rig) -> None:
            bench.robot.imu._identity = identity
            bench.robot.imu.reset()

        return do

    out = imu_trial(rig(), swap(0x70), swap(0x71), params=MpuParams(chip="mpu9250"))
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert any(text.startswith("IMU_ID imu: got 0x70 (MPU-6500") for text in out.messages)
    assert out.recovered <= 0.75


def test_a_chip_that_measures_no_more_is_silenced_at_once_and_told_within_150_ms(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    out = imu_trial(
        bench,
        lambda _: monkeypatch.setattr(bench.robot.imu, "_begin", lambda now: None),
        lambda _: monkeypatch.undo(),
    )
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert out.noticed <= 0.15
    assert out.messages[0].startswith("IMU_STUCK imu: no new sample for 0.1")
    assert out.recovered == pytest.approx(PERIOD)


def test_a_chip_that_repeats_itself_is_silenced_at_once_and_told_within_150_ms(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    out = imu_trial(
        bench,
        lambda _: monkeypatch.setattr(bench.robot.imu, "_sample", lambda t: None),
        lambda _: monkeypatch.undo(),
    )
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert out.noticed <= 0.15
    assert out.messages[0].startswith("IMU_STUCK imu: sample unchanged for 0.1")
    assert out.recovered == pytest.approx(PERIOD)


@pytest.mark.parametrize("part", ["gyro", "accelerometer"])
def test_one_half_that_repeats_itself_is_silenced_with_its_first_repetition(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    bench = rig()
    chip = bench.robot.imu
    name = {"gyro": "_angular_velocity", "accelerometer": "_specific_force"}[part]
    still = getattr(chip, name)(2.0)
    out = imu_trial(
        bench,
        lambda _: monkeypatch.setattr(chip, name, lambda t: still),
        lambda _: monkeypatch.undo(),
    )
    assert out.sent <= 1, "what it stopped at"
    assert out.noticed <= 0.15
    assert out.messages[0].startswith(f"IMU_STUCK imu: {part} unchanged for 0.1")
    assert (out.states, out.after) == ({"ok", "fault"}, "ok")
    assert out.recovered == pytest.approx(PERIOD)


def test_still_sensors_give_no_false_alarm_at_any_range_or_bandwidth() -> None:
    """Noise as small as the data sheets have it, filtered, five minutes in all."""
    dice = random.Random(11)
    for gyro_range, accel_range, bandwidth in ((500, 4, 92.0), (2000, 16, 5.0), (250, 2, 5.0)):
        health = Health(state="ok")
        guard = Guard("imu", health, (gyro_range, accel_range), bandwidth, 1000.0)
        spread = (1.57 * bandwidth) ** 0.5 * 32768.0
        gyro, accel = 0.01 * spread / gyro_range, 300e-6 * spread / accel_range
        keep = 0.85 if bandwidth < 10.0 else 0.1  # from one sample at 200 Hz to the next
        state, held = [0.0] * 7, 0
        sds = (accel,) * 3 + (3.0,) + (gyro,) * 3
        for i in range(20_000):
            state = [
                keep * x + (1.0 - keep * keep) ** 0.5 * sd * dice.gauss(0.0, 1.0)
                for x, sd in zip(state, sds, strict=True)
            ]
            raw = b"".join(round(x).to_bytes(2, "big", signed=True) for x in state)
            held += not guard.passes(i * PERIOD, raw)
        assert (health.state, health.events) == ("ok", 0)
        assert held <= 20, f"{gyro_range} deg/s, {accel_range} g: one in a thousand at most"


@pytest.mark.parametrize(
    ("name", "value", "code"),
    [
        ("_angular_velocity", (0.0, 0.0, 12.0), "GYRO_CLIP imu: gyro at the end of its 500 deg/s"),
        ("_angular_velocity", (0.0, -9.0, 0.0), "GYRO_CLIP imu: gyro at the end of its 500 deg/s"),
        ("_specific_force", (0.0, 45.0, 9.8), "ACCEL_CLIP imu: accelerometer at the end of its 4"),
    ],
)
def test_a_clipped_sample_is_dropped_and_the_state_degraded(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch, name: str, value: Field, code: str
) -> None:
    bench = rig()
    dice = random.Random(2)
    chip = bench.robot.imu
    out = imu_trial(
        bench,
        lambda _: monkeypatch.setattr(
            chip, name, lambda t: tuple(x + dice.gauss(0.0, 0.01) for x in value)
        ),
        lambda _: monkeypatch.undo(),
    )
    assert (out.false, out.sent, out.states, out.after) == (0, 0, {"degraded"}, "ok")
    assert out.messages[0].startswith(code)
    assert out.noticed <= PERIOD * 1.01
    assert out.recovered <= PERIOD * 1.01


def mag_trial(bench: Rig, begin: Callable[[], object], end: Callable[[], object]) -> Outcome[Field]:
    """The magnetometer under a fault; false is a field that is not there."""
    imu, mag = Mpu(bench.bus), Ak8963(bench.bus)
    sense = bench.robot.mag._magnetic_field

    def read(now: float) -> Field | None:
        imu.read(now)
        return mag.read(now) if imu.link.up else None

    def true(now: float, got: Field) -> bool:
        return all(abs(a - b) < 4e-6 for a, b in zip(sense(now), got, strict=True))

    out = suffer(bench, 100.0, read, lambda: mag.health, true, begin, end)
    print(f"\n{out}")
    return out


def test_a_field_too_strong_is_never_sent_and_told_at_once(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    strong = (4000e-6, 900e-6, 50e-6)
    out = mag_trial(
        bench,
        lambda: monkeypatch.setattr(bench.robot.mag, "_magnetic_field", lambda t: strong),
        monkeypatch.undo,
    )
    assert out.sent <= 1, "the measurement of before"
    assert (out.false, out.after) == (0, "ok")
    assert out.messages[0] == "MAG_OVERFLOW mag: field too strong, readings dropped"
    assert out.noticed <= 0.03
    assert out.recovered <= 0.03


def test_a_magnetometer_that_repeats_itself_is_silenced(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig(speed=0.0)
    still = bench.robot.mag._magnetic_field(2.0)
    out = mag_trial(
        bench,
        lambda: monkeypatch.setattr(bench.robot.mag, "_magnetic_field", lambda t: still),
        monkeypatch.undo,
    )
    assert out.sent <= 1, "what it stopped at"
    assert out.false == 0
    assert out.noticed <= 0.3
    assert out.messages[0] == "MAG_STUCK mag: field unchanged over 25 measurements"
    assert (out.after, out.recovered <= 0.03) == ("ok", True)


def test_a_magnetometer_that_measures_nothing_is_told_within_0_6_s(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    out = mag_trial(
        bench,
        lambda: monkeypatch.setattr(bench.robot.mag, "_measure", lambda t, count: None),
        monkeypatch.undo,
    )
    assert out.sent <= 1
    assert out.noticed <= 0.6
    assert out.messages[0] == "MAG_SILENT mag: AK8963 answers, but measures nothing"
    assert (out.after, out.recovered <= 0.03) == ("ok", True)


def wheel_trial(
    bench: Rig, begin: Callable[[], object], end: Callable[[], object], lasts: float = 0.5
) -> Outcome[tuple[int, int]]:
    """The encoders under a fault; false is any way that the wheels did not make."""
    encoders = Encoders(bench.bus)
    reference: list[tuple[tuple[int, int], tuple[float, float]]] = []

    def true(now: float, got: tuple[int, int]) -> bool:
        state = bench.robot.state
        wheels = (state.left_angle, state.right_angle)
        if got == (0, 0):
            reference.clear()  # announced: counts start anew
        if not reference:
            reference.append((got, wheels))
        counts, angles = reference[0]
        per_radian = TURN / 6.283185307179586
        return all(
            abs((new - old) - (wheel - was) * per_radian) < 60
            for new, old, wheel, was in zip(got, counts, wheels, angles, strict=True)
        )

    out = suffer(bench, 100.0, encoders.read, lambda: encoders.health, true, begin, end, lasts)
    print(f"\n{out}")
    return out


@pytest.mark.parametrize(
    ("flags", "state", "text"),
    [
        (0x09, "degraded", "magnet too far"),
        (0x05, "degraded", "magnet too near"),
        (0x03, "fault", "angle not valid"),
        (0x00, "fault", "just switched on"),
    ],
)
def test_what_an_encoder_says_of_its_magnet_comes_with_the_very_reading(
    rig: MakeRig, flags: int, state: str, text: str
) -> None:
    bench = rig()
    left = bench.robot.left

    def set_flags(value: int) -> Callable[[], None]:
        return lambda: setattr(left, "flags", value)

    out = wheel_trial(bench, set_flags(flags), set_flags(0x01))
    assert (out.false, out.states, out.after) == (0, {state}, "ok")
    assert out.messages[0] == f"ENC_MAGNET encoders left: {text}"
    assert out.sent == (50 if state == "degraded" else 0)
    # Readings are 10 ms apart. A magnet that only sits badly interrupts nothing: the next reading
    # counts. After half a second of silence the wheel may have gone round more than once, and only
    # the speed after it, which takes 15 ms to know, tells how often: so two readings wait.
    assert out.recovered <= (0.011 if state == "degraded" else 0.031)


def test_an_angle_that_jumps_for_a_moment_is_left_out(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    left = bench.robot.left
    turn = left._turn
    out = wheel_trial(
        bench,
        lambda: monkeypatch.setattr(left, "_turn", lambda t: (turn(t) + 0.45) % 1.0),
        monkeypatch.undo,
        lasts=0.03,
    )
    assert (out.false, out.sent, out.lost) == (0, 0, 3)
    assert out.messages == ["ENC_JUMP encoders left: too large a step, reading dropped"]


def test_an_angle_that_jumps_for_good_starts_the_counts_anew(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    left = bench.robot.left
    turn = left._turn
    out = wheel_trial(
        bench,
        lambda: monkeypatch.setattr(left, "_turn", lambda t: (turn(t) + 0.45) % 1.0),
        lambda: None,
    )
    assert (out.false, out.lost) == (0, 5)
    assert out.messages[1] == "ENC_GAP encoders left: angle jumped, counts from 0"


@pytest.mark.parametrize("zero", ["angle", "everything"])
def test_an_encoder_that_answers_zeros_never_makes_a_jump(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch, zero: str
) -> None:
    """What programs make of a failed read: the angle 0. And a line that is held low."""
    bench = rig()
    right = bench.robot.right
    begin: dict[str, Callable[[], Any]] = {
        "angle": lambda: monkeypatch.setattr(right, "_turn", lambda t: 0.0),
        "everything": lambda: monkeypatch.setattr(right, "_get", lambda register: 0),
    }
    bench.run(0.87, 100.0, lambda now: None)  # so that zero is far from the angle then
    out = wheel_trial(bench, begin[zero], monkeypatch.undo, lasts=0.04)
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert out.lost == 4
    assert out.messages[0][:10] in ("ENC_JUMP e", "ENC_MAGNET")


@pytest.mark.parametrize("number", [121, 5])
def test_a_bus_error_at_the_encoders_never_makes_a_jump(rig: MakeRig, number: int) -> None:
    bench = rig()

    def fail() -> None:
        bench.fail = lambda address: number if address == 0x41 else 0

    out = wheel_trial(bench, fail, lambda: well(bench))
    assert (out.false, out.sent, out.after) == (0, 0, "ok")
    assert out.recovered <= 0.5


def test_a_reed_that_sticks_is_masked_after_three_magnets(rig: MakeRig) -> None:
    bench = rig(speed=0.2)
    bar = ReedBar(bench.bus)
    chip = bench.robot.bar
    low = chip._pulled_low
    bench.run(1.0, 100.0, bar.read)
    begun = bench.robot.state
    chip._pulled_low = lambda t: low(t) | 0b00000100
    got = bench.run(20.0, 100.0, bar.read)
    masked = next(now for now, closed in got if closed is not None and not closed & 0b100)
    assert bar.health.message == "REED_STUCK bar: 3 masked, does not open - check the reed"
    assert bar.health.state == "degraded"
    assert all(closed is not None and not closed & 0b100 for now, closed in got if now >= masked)
    others = [(closed or 0) & 0b11111011 for now, closed in got if now >= masked]
    assert len(set(others)) > 5, "the others go on"
    way = (masked - 1.0) * 0.2
    assert begun.v == pytest.approx(0.2, rel=0.1)
    print(f"\nmasked after {way:.2f} m")
    assert way <= 0.2
    chip._pulled_low = low
    bench.run(5.0, 100.0, bar.read)
    assert (bar.health.state, bar.health.message) == ("ok", "REED_FREE bar: all reeds open again")


@pytest.mark.parametrize("speed", [0.0, 0.05, 0.3])
def test_no_reed_that_works_is_masked_on_the_course_or_at_rest(rig: MakeRig, speed: float) -> None:
    bench = rig(speed=speed)
    bar = ReedBar(bench.bus)
    low = bench.robot.bar._pulled_low
    got = bench.run(20.0, 100.0, lambda now: (bar.read(now), low(now)))
    assert all(seen == there for _, (seen, there) in got)
