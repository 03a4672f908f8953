"""The MPU-9250's driver: right figures, and no fault of the bus gets past it."""

from __future__ import annotations

import random
from collections.abc import Sequence
from itertools import pairwise
from math import hypot

import pytest

from lodeline.devices.link import DeviceError
from lodeline.devices.mpu import ImuReading, Mpu
from lodeline.devices.mpu_models import MpuParams
from lodeline.sim.chips.mpu import MpuChip
from tests.devices.rig import MakeRig

Vector = tuple[float, float, float]
RATE = 200.0
GONE = 121
GONE_TEXT = "I2C_GONE imu: no answer at 0x68 on bus model (errno 121) - check cable and power"


def mean(vectors: Sequence[Vector]) -> list[float]:
    return [sum(vector[axis] for vector in vectors) / len(vectors) for axis in range(3)]


def rates(readings: Sequence[ImuReading]) -> list[float]:
    return mean([reading.angular_velocity for reading in readings])


def forces(readings: Sequence[ImuReading]) -> list[float]:
    return mean([reading.linear_acceleration for reading in readings])


def good(got: list[tuple[float, ImuReading | None]]) -> list[ImuReading]:
    return [reading for _, reading in got if reading is not None]


def test_at_rest_it_feels_one_g_upwards_and_its_own_bias(rig: MakeRig) -> None:
    bench = rig(speed=0.0)
    imu = Mpu(bench.bus)
    readings = good(bench.run(5.0, RATE, imu.read))
    assert forces(readings) == pytest.approx([0.0, 0.0, 9.80665], abs=0.005)
    assert rates(readings) == pytest.approx([0.012, -0.008, 0.006], abs=0.0005)
    assert readings[-1].temperature == pytest.approx(27.2, abs=0.2)
    assert imu.health.state == "ok"


@pytest.mark.parametrize("turn", [-1.0, 1.0])
def test_a_turn_to_the_left_is_positive_about_z(rig: MakeRig, turn: float) -> None:
    bench = rig(slip=0.0, left_scale_error=0.0, right_scale_error=0.0)
    imu = Mpu(bench.bus)

    def read(now: float) -> ImuReading | None:
        bench.robot.command(0.0, turn)
        return imu.read(now)

    readings = good(bench.run(2.0, RATE, read))[-200:]
    assert rates(readings)[2] == pytest.approx(turn + 0.006, abs=0.005)


def test_gyro_and_truth_turn_by_the_same_angle_on_the_course(rig: MakeRig) -> None:
    bench = rig(gyro_bias=(0.0, 0.0, 0.0), bump_height=0.0)
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    begin = bench.robot.truth().yaw
    readings = good(bench.run(8.0, RATE, imu.read))
    assert len(readings) == 1600
    turned = sum(reading.angular_velocity[2] for reading in readings) / RATE
    true = bench.robot.truth().yaw - begin
    assert true > 1.0
    assert turned == pytest.approx(true, abs=0.01)


def test_a_turn_pulls_towards_its_centre(rig: MakeRig) -> None:
    bench = rig(slip=0.0, accel_noise=0.005, bump_height=0.0)
    imu = Mpu(bench.bus)

    def read(now: float) -> ImuReading | None:
        bench.robot.command(0.3, 1.5)
        return imu.read(now)

    readings = good(bench.run(2.0, RATE, read))[-100:]
    truth = bench.robot.truth()
    assert forces(readings)[1] == pytest.approx(truth.v * truth.w, abs=0.002)
    assert truth.v * truth.w == pytest.approx(0.45, rel=0.02)


@pytest.mark.parametrize(("accel_range", "gyro_range"), [(2, 250), (16, 2000)])
def test_figures_do_not_depend_on_the_ranges(
    rig: MakeRig, accel_range: int, gyro_range: int
) -> None:
    bench = rig(speed=0.0, gyro_bias=(0.5, -1.0, 2.0))
    params = MpuParams(accel_range=accel_range, gyro_range=gyro_range)  # type: ignore[arg-type]
    readings = good(bench.run(2.0, RATE, Mpu(bench.bus, params).read))
    assert rates(readings) == pytest.approx([0.5, -1.0, 2.0], abs=0.003)
    assert forces(readings) == pytest.approx([0.0, 0.0, 9.80665], abs=0.01)


@pytest.mark.parametrize(
    ("identity", "what"),
    [
        (0x70, r"got 0x70 \(MPU-6500: no magnetometer\), expected 0x71 \(MPU-9250\) at 0x68"),
        (0x73, r"got 0x73 \(MPU-9255\)"),
        (0x68, r"got 0x68 \(MPU-9150 or MPU-6050: no magnetometer\)"),
        (0x00, r"got 0x00 \(unknown chip\)"),
        (0xFF, r"got 0xff \(unknown chip\)"),
    ],
)
def test_another_chip_is_refused_by_name(rig: MakeRig, identity: int, what: str) -> None:
    bench = rig()
    chip = MpuChip(
        lambda: 0.0, lambda t: (0.0, 0.0, 0.0), lambda t: (0.0, 0.0, 0.0), lambda t: 0.0, identity
    )
    bench.robot.bus.attach(0x68, chip)
    with pytest.raises(DeviceError, match=rf"IMU_ID imu: {what}"):
        Mpu(bench.bus, MpuParams(chip="mpu9250"))


@pytest.mark.parametrize("identity", [0x00, 0x19, 0x98, 0xFF])
def test_an_unknown_chip_is_refused_whatever_was_declared(rig: MakeRig, identity: int) -> None:
    bench = rig()
    bench.robot.imu._identity = identity
    text = rf"IMU_ID imu: got 0x{identity:02x} \(unknown chip\), expected 0x68, 0x70, 0x71, 0x73 at"
    with pytest.raises(DeviceError, match=text) as caught:
        Mpu(bench.bus)
    assert caught.value.exit_code == 69


def test_a_chip_that_is_not_there_yet_is_awaited_without_an_exception(rig: MakeRig) -> None:
    bench = rig()
    bench.fail = lambda address: GONE
    imu = Mpu(bench.bus)
    assert all(reading is None for _, reading in bench.run(3.0, RATE, imu.read))
    assert (imu.health.state, imu.health.message) == ("fault", GONE_TEXT)
    assert imu.health.events == 1, "said once"
    bench.fail = lambda address: 0
    got = bench.run(2.5, RATE, imu.read)
    assert any(reading is not None for _, reading in got)
    assert (imu.health.state, imu.health.message) == ("ok", "I2C_BACK imu: answers again")


def test_it_is_up_within_0_3_s(rig: MakeRig) -> None:
    bench = rig()
    imu = Mpu(bench.bus)
    first = next(now for now, reading in bench.run(1.0, RATE, imu.read) if reading is not None)
    assert first <= 0.3


def test_one_reading_is_one_transaction_and_checks_are_rare(rig: MakeRig) -> None:
    bench = rig()
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    before = bench.transactions
    bench.run(1.0, RATE, imu.read)
    assert bench.transactions - before <= 200 + 3 * 11


def test_a_chip_that_resets_in_flight_is_set_up_again(rig: MakeRig) -> None:
    bench = rig(speed=0.0)
    imu = Mpu(bench.bus, MpuParams(accel_range=16))
    bench.run(1.0, RATE, imu.read)
    bench.robot.imu.reset()  # now at 2 g: readings are eight times too large
    at = bench.now
    got = bench.run(1.0, RATE, imu.read)
    strange = [
        now - at for now, r in got if r is not None and abs(r.linear_acceleration[2] - 9.8) > 1.0
    ]
    assert strange == []
    silent = [now - at for now, r in got if r is None]
    assert silent[-1] <= 0.2
    assert imu.health.message == "IMU_RESET imu: registers lost, reconfigured"
    assert imu.health.state == "ok"
    assert imu.health.recovered == 1


@pytest.mark.parametrize("register", [0x19, 0x1B, 0x1C, 0x37, 0x6B])
def test_any_lost_setting_is_noticed(rig: MakeRig, register: int) -> None:
    bench = rig(speed=0.0)
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    other = {0x19: 7, 0x1B: 0x18, 0x1C: 0x18, 0x37: 0x00, 0x6B: 0x41}[register]
    bench.robot.imu.write(bytes((register, other)))
    bench.run(0.5, RATE, imu.read)
    assert imu.health.recovered == 1
    assert good(bench.run(0.1, RATE, imu.read))[-1].linear_acceleration[2] == pytest.approx(
        9.8, abs=0.2
    )


def test_a_chip_that_keeps_no_settings_is_reported(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    monkeypatch.setattr(bench.robot.imu, "_set", lambda register, value: None)
    imu = Mpu(bench.bus)
    assert good(bench.run(2.0, RATE, imu.read)) == []
    assert imu.health.message == "IMU_SETTINGS imu: the chip does not keep its settings"
    assert imu.health.state == "fault"


def test_one_failure_in_a_hundred_costs_no_sample(rig: MakeRig) -> None:
    bench = rig()
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    dice = random.Random(121)
    injected = 0

    def fail(address: int) -> int:
        nonlocal injected
        hit = dice.random() < 0.01
        injected += hit
        return dice.choice((121, 6, 5)) if hit else 0  # adapters disagree on which it is

    bench.fail = fail
    got = bench.run(60.0, RATE, imu.read)
    assert injected > 50
    assert len(good(got)) >= 0.999 * len(got)
    assert imu.health.state == "ok"
    assert imu.health.message.startswith("I2C_NACK imu: 1 read failed (errno ")
    assert 0 < imu.health.retried <= injected


@pytest.mark.parametrize("outage", [1.0, 5.0])
def test_a_bus_that_goes_is_reported_and_one_that_returns_is_used(
    rig: MakeRig, outage: float
) -> None:
    bench = rig(speed=0.0)
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    bench.fail = lambda address: GONE
    bench.run(0.2, RATE, imu.read)
    assert (imu.health.state, imu.health.message) == ("fault", GONE_TEXT)
    assert imu.health.failed == 10
    before = bench.transactions
    got = bench.run(outage - 0.2, RATE, imu.read)
    assert good(got) == []
    assert bench.transactions - before <= 2 + 2 * outage, "a bus in trouble is not hammered"
    bench.fail = lambda address: 0
    back = bench.now
    got = bench.run(3.0, RATE, imu.read)
    first, reading = next((now, r) for now, r in got if r is not None)
    assert first - back <= 0.75
    assert reading.linear_acceleration[2] == pytest.approx(9.8, abs=0.2)
    assert (imu.health.state, imu.health.recovered) == ("ok", 1)


def test_a_silent_chip_is_tried_with_pauses_from_0_2_to_0_5_s_on_a_bus_opened_anew(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    opened: list[float] = []
    monkeypatch.setattr(bench.bus, "reopen", lambda: opened.append(bench.now))
    bench.fail = lambda address: GONE
    bench.run(20.0, RATE, imu.read)
    pauses = [after - before for before, after in pairwise(opened)]
    assert pauses[:2] == pytest.approx([0.4, 0.5], abs=0.006)
    assert pauses[2:] == pytest.approx([0.5] * len(pauses[2:]), abs=0.006)
    assert len(opened) == 40


def test_nine_failures_in_a_row_are_no_fault_however_often(rig: MakeRig) -> None:
    bench = rig()
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    for _ in range(5):
        bench.fail = lambda address: GONE
        bench.run(9 / RATE, RATE, imu.read)
        bench.fail = lambda address: 0
        assert len(good(bench.run(1 / RATE, RATE, imu.read))) == 1
    assert (imu.health.state, imu.health.failed, imu.health.recovered) == ("ok", 45, 0)


def test_another_chip_put_in_while_running_is_named_and_never_raises(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    imu = Mpu(bench.bus, MpuParams(chip="mpu9250"))
    bench.run(1.0, RATE, imu.read)
    monkeypatch.setattr(bench.robot.imu, "_identity", 0x70)
    bench.robot.imu.reset()
    assert good(bench.run(3.0, RATE, imu.read)[50:]) == []
    assert imu.health.message.startswith("IMU_ID imu: got 0x70 (MPU-6500: no magnetometer)")
    assert imu.health.state == "fault"


def test_a_hanging_bus_is_not_tried_thrice_and_named(rig: MakeRig) -> None:
    bench = rig()
    imu = Mpu(bench.bus)
    bench.run(1.0, RATE, imu.read)
    bench.fail = lambda address: 110
    before = bench.transactions
    bench.run(0.1, RATE, imu.read)
    assert bench.transactions - before == 3, "each holds the loop for the adapter's timeout"
    assert imu.health.message.startswith("I2C_HANG imu: bus model")
    assert imu.health.state == "fault"


def test_a_rate_that_the_chip_cannot_do_is_refused() -> None:
    with pytest.raises(ValueError, match=r"sample_rate is 1000 Hz / 1\.\.256, not 300 Hz"):
        MpuParams(sample_rate=300.0)
    with pytest.raises(ValueError, match="sample_rate"):
        MpuParams(sample_rate=0.0)
    assert MpuParams(sample_rate=1000.0 / 3.0).divider == 3


def test_the_course_has_the_level_gravity_it_should(rig: MakeRig) -> None:
    bench = rig(bump_height=0.0)
    readings = good(bench.run(20.0, RATE, Mpu(bench.bus).read))
    x, y, z = forces(readings)
    assert hypot(x, y) < 0.15
    assert z == pytest.approx(9.80665, abs=0.005)
