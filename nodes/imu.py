"""Driver of an MPU-9250: gyro and accelerometer in one burst, and its magnetometer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.devices import Ak8963, Ak8963Params, Mpu9250, Mpu9250Params
from lodeline.i2c import open_bus
from lodeline.node import Driver, Output
from lodeline.stamps import seconds
from lodeline_msgs import Imu, MagneticField


@dataclass(frozen=True, slots=True)
class ImuParams:
    """Which bus, how often, and how the two chips are set."""

    bus: Annotated[int | str, "number of the I2C bus, or sim"] = "sim"
    rate: Annotated[float, "Hz"] = 200.0
    imu: Mpu9250Params = field(default_factory=Mpu9250Params)
    magnetometer: Ak8963Params = field(default_factory=Ak8963Params)


class ImuDriver(Driver[ImuParams]):
    """Sends what the chips read, in their own axes and uncorrected."""

    data_raw = Output(Imu)
    mag_raw = Output(MagneticField)

    def setup(self) -> None:
        bus = open_bus(self.params.bus, self.context.sim_socket)
        self.imu = Mpu9250(bus, self.params.imu)
        self.magnetometer = Ak8963(bus, self.params.magnetometer)

    def tick(self, stamp: int) -> None:
        now = seconds(stamp)
        reading = self.imu.read(now)
        if reading is None:  # the magnetometer is behind this chip, and cannot answer either
            self.context.follow(self.imu.health)
            return
        self.data_raw.send(Imu(stamp, reading.angular_velocity, reading.linear_acceleration))
        magnetic_field = self.magnetometer.read(now)
        if magnetic_field is not None:
            self.mag_raw.send(MagneticField(stamp, magnetic_field))
        self.context.follow(self.imu.health, self.magnetometer.health)


if __name__ == "__main__":
    from lodeline.process import run

    run(ImuDriver)
