"""Driver of an MPU-9250 or one of its relatives: gyro and accelerometer, and the magnetometer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.devices import STATES, CompassParams, ImuBoard, MpuParams, check_rate
from lodeline.i2c import open_bus
from lodeline.node import Driver, Output
from lodeline_msgs import Imu, MagneticField


@dataclass(frozen=True, slots=True)
class ImuParams:
    """Which bus, how often it is read, and how the two chips are set."""

    bus: Annotated[int | str, "number of the I2C bus, or sim"] = "sim"
    rate: Annotated[float, "Hz"] = 200.0
    imu: MpuParams = field(default_factory=MpuParams)
    magnetometer: CompassParams = field(default_factory=CompassParams)

    def __post_init__(self) -> None:
        check_rate(self.imu, self.rate)


class ImuDriver(Driver[ImuParams]):
    """Sends what the chips read, in their own axes and uncorrected."""

    data_raw = Output(Imu)
    mag_raw = Output(MagneticField)

    def setup(self) -> None:
        p = self.params
        bus = open_bus(p.bus, self.context.sim_socket, self.context.sim_timeout)
        self.board = ImuBoard(bus, self.context.monotonic, p.imu, p.magnetometer)

    def tick(self, stamp: int) -> None:
        readings, magnetic_field = self.board.read(stamp)
        for taken, reading in readings:
            self.data_raw.send(Imu(taken, reading.angular_velocity, reading.linear_acceleration))
        if magnetic_field is not None:
            self.mag_raw.send(MagneticField(stamp, magnetic_field))
        health = self.board.health
        self.context.report(STATES[health.state], health.message)


if __name__ == "__main__":
    from lodeline.process import run

    run(ImuDriver)
