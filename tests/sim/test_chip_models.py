"""The chips do what their data sheets say, seen through smbus2."""

from __future__ import annotations

import struct
from collections.abc import Callable
from math import radians

import pytest

from lodeline.i2c import Bus, open_model
from lodeline.sim.bus import BusModel
from lodeline.sim.chips.ak8963 import Ak8963Chip
from lodeline.sim.chips.as5048b import As5048bChip
from lodeline.sim.chips.mpu import MpuChip
from lodeline.sim.chips.pcf8574 import Pcf8574Chip

IMU, MAG, ENCODER, PORT = 0x68, 0x0C, 0x40, 0x20
G = 9.80665


class Bench:
    """The chips on one bus, with a clock and quantities that a test sets."""

    def __init__(self) -> None:
        self.now = -1.0  # switched on a second ago
        self.rate: Callable[[float], tuple[float, float, float]] = lambda t: (0.0, 0.0, 0.0)
        self.force: Callable[[float], tuple[float, float, float]] = lambda t: (0.0, 0.0, G)
        self.field: Callable[[float], tuple[float, float, float]] = lambda t: (0.0, 20e-6, -40e-6)
        self.turn = 0.0
        self.power_down = 0
        self.low = 0

        def clock() -> float:
            return self.now

        self.imu = MpuChip(clock, lambda t: self.rate(t), lambda t: self.force(t), lambda t: 25.0)
        self.mag = Ak8963Chip(
            clock, lambda t: self.field(t), self.imu.bypassed, sensitivity=(128, 255, 0)
        )
        model = BusModel()
        model.attach(IMU, self.imu)
        model.attach(MAG, self.mag)
        model.attach(ENCODER, As5048bChip(clock, lambda t: self.turn))
        model.attach(PORT, Pcf8574Chip(clock, lambda t: self.low))
        self.bus: Bus = open_model(model)
        self.now = 0.0

    def burst(self) -> tuple[int, ...]:
        """Accelerometer, temperature, gyro as signed 16-bit numbers."""
        return struct.unpack(">7h", bytes(self.bus.read_i2c_block_data(IMU, 0x3B, 14)))

    def measure(self, mode: int = 0x16) -> None:
        """Switch the bypass on and the magnetometer to a mode."""
        self.bus.write_byte_data(IMU, 0x37, 0x02)
        began = self.now
        self.bus.write_byte_data(MAG, 0x0A, 0x00)
        self.now = began + 1e-4 * self.power_down  # which it needs between two modes
        self.bus.write_byte_data(MAG, 0x0A, mode)

    def status(self) -> int:
        return self.bus.read_byte_data(MAG, 0x02)

    def magnetic(self) -> tuple[int, ...]:
        return struct.unpack("<3h", bytes(self.bus.read_i2c_block_data(MAG, 0x03, 6)))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_the_imu_answers_as_an_mpu9250_and_wakes_by_itself(bench: Bench) -> None:
    assert bench.bus.read_byte_data(IMU, 0x75) == 0x71
    assert bench.bus.read_byte_data(IMU, 0x6B) == 0x01


def test_imu_data_are_big_endian_on_the_smallest_ranges_after_reset(bench: Bench) -> None:
    bench.force = lambda t: (0.0, -0.5 * G, G)
    bench.rate = lambda t: (0.0, 0.0, radians(100.0))
    bench.now = 0.01
    ax, ay, az, temperature, gx, gy, gz = bench.burst()
    assert (ax, ay, az) == (0, -8192, 16384), "16384 LSB/g"
    assert (gx, gy) == (0, 0)
    assert gz == pytest.approx(13107, abs=1), "131 LSB/(deg/s)"
    assert temperature == pytest.approx(4 * 333.87, abs=1), "25 degC is 4 K over 21 degC"


@pytest.mark.parametrize(("code", "per_g", "per_dps"), [(1, 8192, 65.5), (3, 2048, 16.4)])
def test_ranges_scale_the_readings(bench: Bench, code: int, per_g: int, per_dps: float) -> None:
    bench.rate = lambda t: (radians(50.0), 0.0, 0.0)
    bench.bus.write_byte_data(IMU, 0x1B, code << 3)
    bench.bus.write_byte_data(IMU, 0x1C, code << 3)
    bench.now = 0.01
    raw = bench.burst()
    assert raw[2] == per_g
    assert raw[4] == pytest.approx(50 * per_dps, abs=2)


def test_a_reading_beyond_the_range_stops_at_its_end(bench: Bench) -> None:
    bench.rate = lambda t: (radians(400.0), radians(-400.0), 0.0)
    bench.now = 0.01
    assert bench.burst()[4:6] == (32767, -32768)


def test_the_imu_holds_a_sample_until_its_own_next_one(bench: Bench) -> None:
    bench.force = lambda t: (t * G, 0.0, G)
    bench.bus.write_i2c_block_data(IMU, 0x19, [9, 2])  # 100 Hz
    delay = 0.00194  # s, of the accelerometer's filter after reset
    for now, taken in ((0.0149, 0.010), (0.0199, 0.010), (0.0201, 0.020)):
        bench.now = now
        assert bench.burst()[0] == round((taken - delay) * 16384)


@pytest.mark.parametrize(
    ("setting", "gyro", "accel"), [(1, 2.9e-3, 5.8e-3), (6, 33.48e-3, 66.96e-3)]
)
def test_filters_make_readings_late(bench: Bench, setting: int, gyro: float, accel: float) -> None:
    bench.force = lambda t: (t * G, 0.0, G)
    bench.rate = lambda t: (0.0, 0.0, radians(100.0 * t))
    bench.bus.write_i2c_block_data(IMU, 0x19, [0, setting, 0, 0, setting])
    bench.now = 0.5001
    raw = bench.burst()
    assert raw[0] == round((0.5 - accel) * 16384)
    assert raw[6] == pytest.approx((0.5 - gyro) * 13107.2, abs=1)


def test_data_ready_is_told_once_a_sample(bench: Bench) -> None:
    bench.bus.write_i2c_block_data(IMU, 0x19, [9, 2])  # 100 Hz
    bench.now = 0.011
    assert bench.bus.read_byte_data(IMU, 0x3A) & 1
    assert not bench.bus.read_byte_data(IMU, 0x3A) & 1
    bench.now = 0.021
    assert bench.bus.read_byte_data(IMU, 0x3A) & 1


def test_a_sleeping_imu_measures_nothing_until_it_is_woken(bench: Bench) -> None:
    bench.force = lambda t: (0.0, 0.0, G if t < 1.0 else -G)
    bench.now = 0.5
    assert bench.burst()[2] == 16384
    bench.bus.write_byte_data(IMU, 0x6B, 0x40)
    bench.now = 2.0
    assert bench.burst()[2] == 16384, "asleep: the last sample stays"
    bench.bus.write_byte_data(IMU, 0x6B, 0x01)
    bench.now = 2.1
    assert bench.burst()[2] == -16384


def test_a_reset_loses_settings_and_bypass_and_clears_itself(bench: Bench) -> None:
    bench.bus.write_i2c_block_data(IMU, 0x19, [4, 3, 0x10, 0x18, 3])
    bench.bus.write_byte_data(IMU, 0x37, 0x02)
    assert bench.bus.read_byte_data(MAG, 0x00) == 0x48
    bench.bus.write_byte_data(IMU, 0x6B, 0x80)
    assert bench.bus.read_i2c_block_data(IMU, 0x19, 5) == [0] * 5
    assert bench.bus.read_byte_data(IMU, 0x6B) == 0x01
    with pytest.raises(OSError):
        bench.bus.read_byte_data(MAG, 0x00)


def test_read_only_registers_keep_their_value(bench: Bench) -> None:
    bench.now = 0.01
    before = bench.burst()
    bench.bus.write_byte_data(IMU, 0x75, 0x00)
    bench.bus.write_i2c_block_data(IMU, 0x3B, [1] * 14)
    assert bench.bus.read_byte_data(IMU, 0x75) == 0x71
    assert bench.burst() == before


def test_the_magnetometer_answers_through_the_bypass_only(bench: Bench) -> None:
    def answers() -> bool:
        try:
            return bench.bus.read_byte_data(MAG, 0x00) == 0x48
        except OSError as error:
            assert error.errno == 121
            return False

    assert not answers()
    bench.bus.write_byte_data(IMU, 0x37, 0x02)
    assert answers()
    bench.bus.write_byte_data(IMU, 0x6A, 0x20)  # the chip's own I2C master takes the bus
    assert not answers()


def test_fuse_rom_is_readable_in_fuse_mode_only(bench: Bench) -> None:
    bench.power_down = 1
    bench.measure(0x16)
    assert bench.bus.read_i2c_block_data(MAG, 0x10, 3) == [0, 0, 0]
    bench.measure(0x1F)
    assert bench.bus.read_i2c_block_data(MAG, 0x10, 3) == [128, 255, 0]
    bench.measure(0x00)
    assert bench.bus.read_i2c_block_data(MAG, 0x10, 3) == [0, 0, 0]


def test_modes_change_through_power_down_only(bench: Bench) -> None:
    bench.measure(0x16)
    bench.bus.write_byte_data(MAG, 0x0A, 0x1F)
    assert bench.bus.read_byte_data(MAG, 0x0A) == 0x16
    bench.bus.write_byte_data(MAG, 0x0A, 0x00)
    bench.bus.write_byte_data(MAG, 0x0A, 0x1F)
    assert bench.bus.read_byte_data(MAG, 0x0A) == 0x00, "within 0.1 ms it takes none"
    bench.now += 1.1e-4
    bench.bus.write_byte_data(MAG, 0x0A, 0x1F)
    assert bench.bus.read_byte_data(MAG, 0x0A) == 0x1F


def test_magnetic_data_are_little_endian_in_the_axes_of_the_die(bench: Bench) -> None:
    bench.field = lambda t: (10e-6, -30e-6, 45e-6)
    bench.measure()
    bench.now = 0.011
    x, y, z = bench.magnetic()
    # die (x, y, z) = (y, x, -z); sensitivity 1.0, 1 + 127/256 and 0.5
    assert x == round(-30e-6 / 0.15e-6)
    assert y == round(10e-6 / (0.15e-6 * 383 / 256))
    assert z == round(-45e-6 / (0.15e-6 * 0.5))


def test_14_bit_readings_are_four_times_coarser(bench: Bench) -> None:
    bench.field = lambda t: (0.0, 30e-6, 0.0)
    bench.measure(0x06)
    bench.now = 0.011
    assert bench.magnetic()[0] == 50
    assert not bench.bus.read_byte_data(MAG, 0x09) & 0x10


def test_the_magnetometer_measures_a_hundred_times_a_second(bench: Bench) -> None:
    bench.measure()
    fresh = 0
    for i in range(1000):
        bench.now = 0.001 * (i + 1)
        fresh += bench.bus.read_i2c_block_data(MAG, 0x02, 8)[0] & 1
    assert fresh == 100


def test_magnetic_data_are_held_until_st2_is_read(bench: Bench) -> None:
    bench.field = lambda t: (0.0, t * 1e-3, 0.0)
    bench.measure()
    bench.now = 0.011
    first = bench.magnetic()
    bench.now = 0.055
    assert bench.status() == 0x02, "the chip says that it lost measurements"
    assert bench.magnetic() == first, "nothing new without ST2"
    bench.bus.read_byte_data(MAG, 0x09)
    bench.now = 0.061
    assert bench.magnetic()[0] == round(0.060e-3 / 0.15e-6)


def test_data_ready_falls_and_overrun_tells_of_skipped_measurements(bench: Bench) -> None:
    bench.measure()
    assert bench.status() == 0
    bench.now = 0.011
    assert bench.status() == 0x01
    bench.bus.read_i2c_block_data(MAG, 0x03, 7)  # data and ST2
    assert bench.status() == 0
    bench.now = 0.045
    assert bench.status() == 0x03


def test_a_field_too_strong_is_flagged(bench: Bench) -> None:
    bench.measure()
    bench.field = lambda t: (2000e-6, 2000e-6, -900e-6)
    bench.now = 0.011
    assert bench.bus.read_i2c_block_data(MAG, 0x03, 7)[6] == 0x10, "16 bit, no overflow"
    bench.field = lambda t: (2000e-6, 2000e-6, -912e-6)
    bench.now = 0.021
    assert bench.bus.read_i2c_block_data(MAG, 0x03, 7)[6] == 0x18


def test_a_single_measurement_ends_in_power_down(bench: Bench) -> None:
    bench.measure(0x11)
    bench.now = 0.005
    assert bench.status() == 0
    bench.now = 0.008
    assert bench.status() == 1
    assert bench.bus.read_byte_data(MAG, 0x0A) & 0x0F == 0


def test_a_soft_reset_stops_the_magnetometer(bench: Bench) -> None:
    bench.measure()
    bench.bus.write_byte_data(MAG, 0x0B, 0x01)
    bench.now = 0.1
    assert bench.status() == 0
    assert bench.bus.read_byte_data(MAG, 0x0A) == 0


@pytest.mark.parametrize("angle", [0, 1, 63, 64, 8191, 16383])
def test_the_encoder_splits_14_bits_into_eight_and_six(bench: Bench, angle: int) -> None:
    bench.turn = (angle + 0.5) / 16384
    high, low = bench.bus.read_i2c_block_data(ENCODER, 0xFE, 2)
    assert low < 64
    assert high << 6 | low == angle


def test_the_encoder_tells_how_its_magnet_sits(bench: Bench) -> None:
    assert bench.bus.read_i2c_block_data(ENCODER, 0xFA, 4) == [128, 0x01, 4096 >> 6, 4096 & 0x3F]


def test_a_pin_of_the_port_reads_low_when_pulled_or_written_low(bench: Bench) -> None:
    bench.bus.write_byte(PORT, 0xFF)
    assert bench.bus.read_byte(PORT) == 0xFF
    bench.low = 0b00011000
    assert bench.bus.read_byte(PORT) == 0b11100111
    bench.bus.write_byte(PORT, 0b01111111)
    assert bench.bus.read_byte(PORT) == 0b01100111
