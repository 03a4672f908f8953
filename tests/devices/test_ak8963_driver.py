"""The magnetometer's driver: the field in the gyro's axes, nothing stale, nothing overflowed."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import atan2, cos, pi, sin

import pytest

from lodeline.devices.ak8963 import Ak8963
from lodeline.devices.mpu import Mpu
from tests.devices.rig import MakeRig, Rig

Field = tuple[float, float, float]
CLEAN = {
    "hard_iron": (0.0, 0.0, 0.0),
    "soft_iron": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
}


def both(bench: Rig) -> tuple[Mpu, Ak8963, Callable[[float], Field | None]]:
    """Both drivers as a node runs them: the magnetometer once the gyro delivers."""
    imu, mag = Mpu(bench.bus), Ak8963(bench.bus)

    def read(now: float) -> Field | None:
        return None if imu.read(now) is None else mag.read(now)

    return imu, mag, read


def mean(bench: Rig, read: Callable[[float], Field | None]) -> Field:
    """The mean field of 2 s, whose noise is some 0.04 uT."""
    fields = [field for _, field in bench.run(2.0, 200.0, read) if field is not None]
    x, y, z = (sum(axis) / len(fields) for axis in zip(*fields, strict=True))
    return x, y, z


def test_the_field_has_its_strength_and_dip_and_points_north(rig: MakeRig) -> None:
    bench = rig(speed=0.0, **CLEAN)
    _, mag, read = both(bench)
    level = 47e-6 * cos(1.1)
    # the robot heads east: north is on its left
    assert mean(bench, read) == pytest.approx((0.0, level, -47e-6 * sin(1.1)), abs=0.15e-6)
    assert mag.health.state == "ok"
    assert mag.health.events == 0, "the bypass was on before it was asked"


def test_the_heading_of_the_field_follows_the_robot(rig: MakeRig) -> None:
    bench = rig(mag_noise=0.1e-6, bump_height=0.0, slip=0.0, **CLEAN)
    _, _, read = both(bench)

    def heading(now: float) -> tuple[float, float] | None:
        field = read(now)
        if field is None:
            return None
        yaw = atan2(field[0], field[1])  # north is (sin yaw, cos yaw) in the body
        return yaw, bench.robot.truth().yaw

    pairs = [pair for _, pair in bench.run(30.0, 100.0, heading) if pair is not None]
    errors = [(yaw - true + pi) % (2 * pi) - pi for yaw, true in pairs]
    assert max(true for _, true in pairs) > 3.0
    assert min(true for _, true in pairs) < -3.0
    assert max(map(abs, errors)) < 0.035, "a sample of 10 ms ago, one LSB and some noise"


def test_iron_shifts_the_field_as_declared(rig: MakeRig) -> None:
    bench = rig(speed=0.0)
    _, _, read = both(bench)
    field = mean(bench, read)
    y, z = 47e-6 * cos(1.1), -47e-6 * sin(1.1)
    assert field == pytest.approx(
        (11.5e-6 + 0.02 * y, -1e-6 + 0.95 * y + 0.01 * z, 6e-6 + 0.01 * y + 0.99 * z), abs=0.15e-6
    )


def test_every_measurement_comes_once(rig: MakeRig) -> None:
    bench = rig()
    _, _, read = both(bench)
    bench.run(1.0, 200.0, read)
    fields = [field for _, field in bench.run(2.0, 200.0, read) if field is not None]
    assert len(fields) in (199, 200, 201)
    repeated = sum(a == b for a, b in pairwise(fields))
    assert repeated < 10, "noise alone tells two measurements apart"


def test_an_overflow_is_dropped_and_counted(rig: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = rig(speed=0.0)
    _, mag, read = both(bench)
    bench.run(1.0, 200.0, read)
    monkeypatch.setattr(bench.robot.mag, "_magnetic_field", lambda t: (4000e-6, 900e-6, 50e-6))
    bench.run(0.02, 200.0, read)
    before = mag.overflows
    got = bench.run(0.5, 200.0, read)
    assert all(field is None for _, field in got)
    assert 49 <= mag.overflows - before <= 51
    assert mag.health.message == "MAG_OVERFLOW mag: field too strong, readings dropped"
    assert mag.health.state == "degraded"
    monkeypatch.undo()
    got = bench.run(0.1, 200.0, read)
    assert any(field is not None for _, field in got)


def test_a_reset_of_the_whole_chip_brings_both_back(rig: MakeRig) -> None:
    bench = rig(speed=0.0)
    imu, mag, read = both(bench)
    bench.run(1.0, 200.0, read)
    bench.robot.imu.reset()
    bench.robot.mag.reset()
    at = bench.now
    got = bench.run(1.0, 200.0, read)
    fresh = [now - at for now, field in got if field is not None and now - at > 0.1]
    assert fresh[0] < 0.4, "0.1 s until noticed, 0.17 s to set the chip up, then the next field"
    assert len(fresh) > 55
    assert (imu.health.state, mag.health.state) == ("ok", "ok")
    assert imu.health.recovered == 1


def test_a_magnetometer_that_lost_its_mode_measures_again(rig: MakeRig) -> None:
    bench = rig(speed=0.0)
    _, mag, read = both(bench)
    bench.run(1.0, 200.0, read)
    bench.robot.mag.reset()
    got = bench.run(0.3, 200.0, read)
    assert got[-1][1] is not None or got[-2][1] is not None
    assert mag.health.message == "MAG_RESET mag: mode lost, reconfigured"
    assert mag.health.recovered == 1


def test_a_chip_that_is_no_ak8963_is_named_and_never_raises(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    imu, mag, read = both(bench)
    monkeypatch.setattr(bench.robot.mag, "_get", lambda register: 0x13)
    assert all(field is None for _, field in bench.run(3.0, 200.0, read))
    assert mag.health.message == "MAG_ID mag: got 0x13, expected 0x48 (AK8963) at 0x0c"
    assert (imu.health.state, mag.health.state) == ("ok", "fault")
