"""The MPU-9250's relatives, its FIFO and the other port expander do as their data sheets say."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest

from lodeline.i2c import Bus, open_model
from lodeline.sim.bus import BusModel
from lodeline.sim.chips.ak8963 import Ak8963Chip, Ak8975Chip
from lodeline.sim.chips.mcp23017 import Mcp23017Chip
from lodeline.sim.chips.mpu import MpuChip

IMU, MAG, PORT = 0x68, 0x0C, 0x21
G = 9.80665
FRAME = struct.Struct(">7h")
USER_CTRL, FIFO_EN, COUNT, DATA, STATUS = 0x6A, 0x23, 0x72, 0x74, 0x3A


LATE = {0x71: 0.00194, 0x68: 0.003}  # s, by the accelerometer's filter


class Bench:
    """An MPU of some kind that feels how late it is, switched on at 0 s."""

    def __init__(self, identity: int, old_compass: bool = False, clock_error: float = 0.0) -> None:
        self.now = 0.0
        self.low = 0
        self.field: Callable[[float], tuple[float, float, float]] = lambda t: (9e-6, -30e-6, 45e-6)

        def clock() -> float:
            return self.now

        def late(t: float) -> tuple[float, float, float]:
            return t * G / 10.0, 0.0, G

        self.imu = MpuChip(
            clock, lambda t: (1.0, 0.0, 0.0), late, lambda t: 25.0, identity, clock_error
        )
        kind = Ak8975Chip if old_compass else Ak8963Chip
        self.mag = kind(clock, lambda t: self.field(t), self.imu.bypassed, (128, 128, 128))
        self.port = Mcp23017Chip(clock, lambda t: self.low)
        model = BusModel()
        for address, chip in ((IMU, self.imu), (MAG, self.mag), (PORT, self.port)):
            model.attach(address, chip)
        self.bus: Bus = open_model(model)

    def read(self, register: int) -> int:
        return self.bus.read_byte_data(IMU, register)

    def write(self, register: int, *values: int) -> None:
        self.bus.write_i2c_block_data(IMU, register, list(values))

    def fifo_bytes(self) -> int:
        high, low = self.bus.read_i2c_block_data(IMU, COUNT, 2)
        return high << 8 | low

    def pop(self, length: int) -> bytes:
        got = bytearray()
        while len(got) < length:
            got += bytes(self.bus.read_i2c_block_data(IMU, DATA, min(28, length - len(got))))
        return bytes(got)

    def stamps(self, data: bytes) -> list[float]:
        """When each 14-byte sample was taken, as its accelerometer feels it."""
        return [FRAME.unpack(data[i : i + 14])[0] / 1638.4 for i in range(0, len(data) - 13, 14)]

    def start_fifo(self, keep_old: bool = True, divider: int = 0) -> None:
        self.write(0x6B, 0x01)
        self.write(0x19, divider, 0x42 if keep_old else 0x02)
        self.write(FIFO_EN, 0xF8)
        self.write(USER_CTRL, 0x44)


@pytest.mark.parametrize("identity", [0x68, 0x70, 0x71, 0x73])
def test_each_chip_says_who_it_is(identity: int) -> None:
    assert Bench(identity).read(0x75) == identity


def test_the_old_chips_sleep_after_reset_and_the_new_ones_do_not() -> None:
    old, new = Bench(0x68), Bench(0x70)
    for bench in (old, new):
        bench.now = 1.0
    assert (old.read(0x6B), new.read(0x6B)) == (0x40, 0x01)
    assert old.bus.read_i2c_block_data(IMU, 0x3B, 6) == [0] * 6
    old.write(0x6B, 0x01)
    old.now = 1.1
    assert old.bus.read_i2c_block_data(IMU, 0x3F, 2) == [0x40, 0x00], "1 g"


def test_the_old_chips_have_another_thermometer_and_no_filter_of_the_accelerometer() -> None:
    bench = Bench(0x68)
    bench.write(0x6B, 0x01)
    bench.write(0x1D, 0x02)
    bench.now = 0.1
    raw = int.from_bytes(bench.bus.read_i2c_block_data(IMU, 0x41, 2), "big", signed=True)
    assert raw / 340.0 + 36.53 == pytest.approx(25.0, abs=0.01)
    assert bench.read(0x1D) == 0


def test_the_old_chips_have_only_those_flags_that_were_enabled() -> None:
    for identity, flag in ((0x68, 0), (0x70, 1)):
        bench = Bench(identity)
        bench.write(0x6B, 0x01)
        bench.now = 0.05
        assert bench.read(STATUS) == flag
        bench.write(0x38, 0x01)
        bench.now = 0.06
        assert bench.read(STATUS) == 1


def test_the_old_chips_empty_their_fifo_only_while_it_is_off() -> None:
    for identity, left in ((0x68, 10 * 14), (0x71, 0)):
        bench = Bench(identity)
        bench.start_fifo()
        bench.now = 0.0105
        bench.write(USER_CTRL, 0x44)
        assert bench.fifo_bytes() == left
        bench.write(USER_CTRL, 0x04)
        assert bench.fifo_bytes() == 0


def test_the_divider_works_on_8_khz_in_the_old_chips_only() -> None:
    old, new = Bench(0x68), Bench(0x70)
    for bench in (old, new):
        bench.write(0x19, 7)  # no low-pass filter
    assert (old.imu.sample_rate, new.imu.sample_rate) == (1000.0, 8000.0)


def test_the_gyro_reads_nothing_until_it_has_started() -> None:
    bench = Bench(0x71)
    bench.now = 0.034
    assert bench.bus.read_i2c_block_data(IMU, 0x43, 2) == [0, 0]
    bench.now = 0.036
    assert bench.bus.read_i2c_block_data(IMU, 0x43, 2) != [0, 0]


def test_nobody_answers_just_after_power_up() -> None:
    bench = Bench(0x71)
    bench.write(0x37, 0x02)
    bench.imu.power_cycle()
    bench.now = 0.010
    with pytest.raises(OSError, match="121"):
        bench.read(0x75)
    bench.now = 0.012
    assert (bench.read(0x75), bench.read(0x37)) == (0x71, 0x00)


def test_the_fifo_holds_every_sample_in_order() -> None:
    bench = Bench(0x71)
    bench.start_fifo()
    bench.now = 0.0205
    assert bench.fifo_bytes() == 20 * 14
    stamps = bench.stamps(bench.pop(20 * 14))
    assert stamps == pytest.approx([0.001 * i - LATE[0x71] for i in range(1, 21)], abs=4e-4)
    assert bench.fifo_bytes() == 0
    assert bench.pop(3) == b"\xff\xff\xff", "nothing left"


def test_fifo_takes_only_what_it_was_told_to() -> None:
    bench = Bench(0x71)
    bench.start_fifo()
    bench.write(FIFO_EN, 0x70)  # the gyro alone
    bench.write(USER_CTRL, 0x44)
    bench.now = 0.0105
    assert bench.fifo_bytes() == 10 * 6
    bench.write(USER_CTRL, 0x04)
    bench.now = 0.0205
    assert bench.fifo_bytes() == 0, "switched off"


@pytest.mark.parametrize(("identity", "size"), [(0x71, 512), (0x68, 1024)])
def test_a_full_fifo_says_so_and_keeps_the_old_or_the_new(identity: int, size: int) -> None:
    for keep_old in (True, False):
        bench = Bench(identity)
        bench.write(0x38, 0x10)  # only so do the old chips tell of it
        bench.start_fifo(keep_old)
        bench.now = 0.030
        assert not bench.read(STATUS) & 0x10
        bench.now = 0.200
        assert bench.fifo_bytes() == size
        assert bench.read(STATUS) & 0x10
        assert not bench.read(STATUS) & 0x10, "told once"
        data = bench.pop(size)
        if keep_old and identity == 0x71:  # the old chips have no such setting
            assert bench.stamps(data)[0] == pytest.approx(0.001 - LATE[identity], abs=4e-4)
        else:
            assert bench.stamps(data[size % 14 :])[-1] == pytest.approx(
                0.200 - LATE[identity], abs=4e-4
            )


def test_a_chip_whose_clock_is_fast_takes_more_samples() -> None:
    bench = Bench(0x71, clock_error=0.01)
    bench.start_fifo(divider=9)
    taken = 0
    for i in range(1, 101):
        bench.now = 0.1 * i
        taken += bench.fifo_bytes() // 14
        bench.write(USER_CTRL, 0x44)
    assert taken == 1010


def test_the_old_compass_measures_once_when_told_to() -> None:
    bench = Bench(0x68, old_compass=True)
    bench.write(0x6B, 0x01)
    bench.write(0x37, 0x02)
    bus = bench.bus
    assert bus.read_byte_data(MAG, 0x00) == 0x48
    bus.write_byte_data(MAG, 0x0A, 0x16)
    bench.now = 0.1
    assert bus.read_byte_data(MAG, 0x02) == 0, "it knows no continuous mode"
    bus.write_byte_data(MAG, 0x0A, 0x00)
    bench.now = 0.1002
    bus.write_byte_data(MAG, 0x0A, 0x01)
    bench.now = 0.107
    assert bus.read_byte_data(MAG, 0x02) == 0
    bench.now = 0.108
    status, *data, end = bus.read_i2c_block_data(MAG, 0x02, 8)
    assert (status, end, bus.read_byte_data(MAG, 0x0A)) == (1, 0, 0)
    assert struct.unpack("<3h", bytes(data)) == (-100, 30, -150), "0.3 uT, die turned"


def test_the_old_compass_overflows_at_half_of_what_the_new_one_stands() -> None:
    bench = Bench(0x68, old_compass=True)
    bench.write(0x37, 0x02)
    bench.field = lambda t: (1000e-6, 1000e-6, 410e-6)
    bench.bus.write_byte_data(MAG, 0x0A, 0x01)
    bench.now = 0.01
    assert bench.bus.read_i2c_block_data(MAG, 0x02, 8)[7] & 0x08


def test_pins_of_the_mcp23017_float_without_their_pull_ups() -> None:
    bench = Bench(0x71)
    assert bench.bus.read_byte_data(PORT, 0x12) == 0x00
    bench.bus.write_byte_data(PORT, 0x0C, 0xFF)
    assert bench.bus.read_byte_data(PORT, 0x12) == 0xFF
    bench.low = 0b00000110
    assert bench.bus.read_byte_data(PORT, 0x12) == 0b11111001
    bench.port.reset()
    assert bench.bus.read_byte_data(PORT, 0x12) == 0x00


def test_pins_of_the_mcp23017_can_be_turned_round_or_driven() -> None:
    bench = Bench(0x71)
    bench.bus.write_byte_data(PORT, 0x0C, 0xFF)
    bench.bus.write_byte_data(PORT, 0x02, 0x0F)
    assert bench.bus.read_byte_data(PORT, 0x12) == 0xF0
    bench.bus.write_byte_data(PORT, 0x00, 0x7F)  # pin 7 is an output
    assert bench.bus.read_byte_data(PORT, 0x12) == 0x70
    bench.bus.write_byte_data(PORT, 0x12, 0x80)
    assert bench.bus.read_byte_data(PORT, 0x12) == 0xF0
