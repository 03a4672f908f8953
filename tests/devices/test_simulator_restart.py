"""A simulator that is killed and comes back: drivers go on, and the robot stands where it stood."""

from __future__ import annotations

from math import pi
from pathlib import Path

from lodeline.devices import Ak8963, Encoders, Mpu, ReedBar
from lodeline.i2c import open_bus
from lodeline.sim.params import RobotParams
from lodeline.sim.robot import SimulatedRobot
from lodeline.sim.server import I2cServer

PERIOD = 0.01
PER_RADIAN = 16384 / (2.0 * pi)


def test_drivers_outlive_a_restart_of_the_simulator(tmp_path: Path) -> None:
    now = 0.0
    params = RobotParams(encoder_noise=0.0)
    robot = SimulatedRobot(params, lambda: now)
    server = I2cServer(robot.bus, tmp_path / "i2c")
    bus = open_bus("sim", tmp_path / "i2c", None)
    imu, mag, encoders, bar = Mpu(bus), Ak8963(bus), Encoders(bus), ReedBar(bus)

    def read_all() -> tuple[bool, bool, tuple[int, int] | None, bool]:
        inertial = imu.read(now) is not None
        magnetic = inertial and mag.read(now) is not None
        return inertial, magnetic, encoders.read(now), bar.read(now) is not None

    counts = [read_all()[2]]
    for _ in range(300):
        now += PERIOD
        counts.append(read_all()[2])
    before, state = counts[-1], robot.state
    server.close()
    for _ in range(30):
        now += PERIOD
        assert read_all() == (False, False, None, False)
    assert [each.health.state for each in (imu, mag, encoders, bar)] == ["fault", "ok"] + [
        "fault"
    ] * 2, "the magnetometer was not asked while the gyro was silent"

    robot = SimulatedRobot(params, lambda: now, state)  # its chips come fresh from power-on
    with I2cServer(robot.bus, tmp_path / "i2c"):
        got = []
        for _ in range(150):
            now += PERIOD
            got.append(read_all())
    inertial, magnetic, _, reeds = (sum(map(bool, column)) for column in zip(*got, strict=True))
    assert inertial > 60
    assert magnetic > 50
    assert reeds > 90
    assert imu.health.state == "ok"
    after = got[-1][2]
    assert before is not None
    assert after is not None
    true = (robot.state.left_angle * PER_RADIAN, robot.state.right_angle * PER_RADIAN)
    assert abs(after[0] - true[0]) < 3
    assert abs(after[1] - true[1]) < 3
    assert after[0] - before[0] > 10000, "it drove on meanwhile"
    bus.close()
