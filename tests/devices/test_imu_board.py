"""A board is driven as what it is, and says what it lacks."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin

import pytest

from lodeline.devices import Encoders, ImuBoard, ImuReading, MpuParams
from lodeline.i2c import open_bus
from lodeline.sim.adapter import SimulatedFile
from tests.devices.rig import MakeRig, Rig

CLEAN = {
    "hard_iron": (0.0, 0.0, 0.0),
    "soft_iron": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
}


Look = tuple[ImuReading | None, tuple[float, float, float] | None]


def taken(board: ImuBoard) -> Callable[[float], Look]:
    """Read a board without FIFO at a time in seconds."""

    def read(now: float) -> Look:
        samples, field = board.read(round(now * 1e9))
        return samples[0][1] if samples else None, field

    return read


def means(bench: Rig, board: ImuBoard, rate: float = 200.0) -> list[tuple[float, ...]]:
    """Mean rate, force and field over 2 s; what never came is empty."""
    bench.run(1.5, rate, taken(board))
    got = [pair for _, pair in bench.run(2.0, rate, taken(board))]
    rows = [
        [reading.angular_velocity for reading, _ in got if reading],
        [reading.linear_acceleration for reading, _ in got if reading],
        [field for _, field in got if field],
    ]
    return [tuple(sum(axis) / len(row) for axis in zip(*row, strict=True)) for row in rows]


@pytest.mark.parametrize("chip", ["mpu9250", "mpu9255", "mpu9150", "mpu6500", "mpu6050"])
def test_every_chip_gives_the_same_quantities(rig: MakeRig, chip: str) -> None:
    bench = rig(imu_chip=chip, speed=0.0, **CLEAN)
    board = ImuBoard(bench.bus, bench.clock)
    rate, force, field = means(bench, board)
    assert rate == pytest.approx((0.012, -0.008, 0.006), abs=0.0007)
    assert force == pytest.approx((0.0, 0.0, 9.80665), abs=0.01)
    if chip in ("mpu6500", "mpu6050"):
        assert field == ()
    else:
        assert field == pytest.approx((0.0, 47e-6 * cos(1.1), -47e-6 * sin(1.1)), abs=0.3e-6)
    _, (reading, _) = bench.run(0.005, 200.0, taken(board))[0]
    assert reading is not None
    assert reading.temperature == pytest.approx(27.2, abs=0.2)


@pytest.mark.parametrize(("chip", "name"), [("mpu6500", "MPU-6500"), ("mpu6050", "MPU-6050")])
def test_a_board_without_magnetometer_is_degraded_and_says_why(
    rig: MakeRig, chip: str, name: str
) -> None:
    bench = rig(imu_chip=chip)
    board = ImuBoard(bench.bus, bench.clock)
    got = bench.run(3.0, 200.0, taken(board))
    assert board.health.state == "degraded"
    assert board.health.message == (
        f"IMU_CHIP imu: {name}: no magnetometer, heading from the gyro only"
    )
    assert sum(reading is not None for _, (reading, _) in got) > 500
    before = bench.transactions
    bench.run(1.0, 200.0, taken(board))
    assert bench.transactions - before < 200 + 3 * 11, "nobody looks for it any more"


@pytest.mark.parametrize("chip", ["mpu9250", "mpu9255", "mpu9150"])
def test_nine_axes_are_ok_at_100_fields_a_second(rig: MakeRig, chip: str) -> None:
    bench = rig(imu_chip=chip)
    board = ImuBoard(bench.bus, bench.clock)
    bench.run(1.0, 200.0, taken(board))
    fields = sum(field is not None for _, (_, field) in bench.run(2.0, 200.0, taken(board)))
    assert 198 <= fields <= 201
    assert (board.health.state, board.health.message) == ("ok", "")


def test_a_declared_mpu9150_without_its_compass_is_told(rig: MakeRig) -> None:
    bench = rig(imu_chip="mpu6050")
    board = ImuBoard(bench.bus, bench.clock, MpuParams(chip="mpu9150"))
    bench.run(3.0, 200.0, taken(board))
    assert board.health.state == "degraded"
    assert board.health.message.startswith("I2C_GONE mag: no answer at 0x0c on bus model")


def test_an_old_compass_that_was_reset_measures_again(rig: MakeRig) -> None:
    bench = rig(imu_chip="mpu9150")
    board = ImuBoard(bench.bus, bench.clock)
    bench.run(1.0, 200.0, taken(board))
    bench.robot.mag.reset()
    at = bench.now
    got = bench.run(1.0, 200.0, taken(board))
    back = next(now for now, (_, field) in got if field is not None)
    assert back - at <= 0.15
    assert board.health.message.startswith("MAG_RESET mag")
    assert board.health.state == "ok"


def test_a_dead_magnetometer_leaves_the_gyro_usable(rig: MakeRig) -> None:
    bench = rig()
    board = ImuBoard(bench.bus, bench.clock)
    bench.run(1.0, 200.0, taken(board))
    bench.fail = lambda address: 121 if address == 0x0C else 0
    got = bench.run(2.0, 200.0, taken(board))
    assert all(reading is not None for _, (reading, _) in got)
    assert (board.health.state, board.health.message[:13]) == ("degraded", "I2C_GONE mag:")
    bench.fail = lambda address: 0
    bench.run(1.0, 200.0, taken(board))
    assert board.health.state == "ok"


def test_a_bus_that_is_not_there_yet_is_named_once_and_used_as_soon_as_it_is(
    rig: MakeRig,
) -> None:
    """As before `raspi-config`, or while an adapter on USB is unplugged."""
    bench = rig()
    bus = open_bus(97)
    board, wheels = ImuBoard(bus, bench.clock), Encoders(bus)

    def read(now: float) -> int:
        wheels.read(now)
        return len(board.read(round(now * 1e9))[0])

    assert sum(got for _, got in bench.run(2.0, 100.0, read)) == 0
    for health in (board.health, wheels.health):
        assert health.state == "fault"
        assert "no /dev/i2c-97 (there is: " in health.message
        assert health.message.startswith("I2C_BUS ")
    assert board.health.events == 1, "said once"
    there = SimulatedFile(bench)
    bus._descriptors = there
    got = bench.run(1.0, 100.0, read)
    assert next(now for now, count in got if count) - got[0][0] <= 0.75
    assert (board.health.state, wheels.health.state) == ("ok", "ok")
    bus.close()
