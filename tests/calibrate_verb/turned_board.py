"""A board whose IMU a hand lays on each of its six sides, one after the other, for ever."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin

from lodeline.node import Driver, Output
from lodeline.rotation import Vector
from lodeline.sim.bus import BusModel
from lodeline.sim.chips.mpu import GRAVITY, MpuChip
from lodeline.sim.noise import Noise
from lodeline.sim.server import I2cServer
from lodeline_msgs import Imu

# Where the board's z, y and x axes point up, then down: from each to the next is a quarter turn.
SIDES: tuple[Vector, ...] = (
    (0.0, 0.0, 1.0),
    (0.0, 1.0, 0.0),
    (1.0, 0.0, 0.0),
    (0.0, 0.0, -1.0),
    (0.0, -1.0, 0.0),
    (-1.0, 0.0, 0.0),
)
OFFSET: Vector = (0.15, -0.10, 0.20)  # m/s^2
SCALE: Vector = (1.01, 0.98, 1.02)
TURN_S, REST_S = 0.3, 1.1
IMU_ADDRESS, MPU6500 = 0x68, 0x70


def held(t: float) -> tuple[Vector, Vector]:
    """Which way is up and how fast it turns [rad/s], in the board's axes, at a time [s]."""
    place, since = divmod(t, TURN_S + REST_S)
    a, b = (SIDES[(int(place) + more) % len(SIDES)] for more in (0, 1))
    part = min(1.0, since / TURN_S)
    angle = 0.25 * pi * (1.0 - cos(pi * part))
    speed = 0.25 * pi * pi / TURN_S * sin(pi * part)
    x, y, z = (cos(angle) * u + sin(angle) * v for u, v in zip(a, b, strict=True))
    axis = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    wx, wy, wz = (-speed * v for v in axis)  # the world turns against the board
    return (x, y, z), (wx, wy, wz)


@dataclass(frozen=True, slots=True)
class TurnedBoardParams:
    """Nothing can be chosen but how often it tells what is so."""

    rate: float = 50.0


class TurnedBoard(Driver[TurnedBoardParams]):
    """Serves the chip, and tells what it should read."""

    truth = Output(Imu)

    def setup(self) -> None:
        self.start = self.context.monotonic()
        self.noise = Noise(1, 1), Noise(1, 2)
        bus = BusModel()
        chip = MpuChip(self.now, self.rate, self.force, lambda _: 25.0, MPU6500)
        bus.attach(IMU_ADDRESS, chip)
        self.server = I2cServer(bus, self.context.sim_socket)

    def close(self) -> None:
        self.server.close()

    def now(self) -> float:
        return self.context.monotonic() - self.start

    def rate(self, t: float) -> Vector:
        x, y, z = self.noise[0].triple(round(1e6 * t))
        (wx, wy, wz) = held(t)[1]
        return wx + 0.002 * x, wy + 0.002 * y, wz + 0.002 * z

    def force(self, t: float) -> Vector:
        """What the accelerometer makes of gravity: no axis of it is right."""
        up, noise = held(t)[0], self.noise[1].triple(round(1e6 * t))
        x, y, z = (
            scale * GRAVITY * axis + offset + 0.03 * more
            for scale, axis, offset, more in zip(SCALE, up, OFFSET, noise, strict=True)
        )
        return x, y, z

    def tick(self, stamp: int) -> None:
        (x, y, z), rate = held(self.now())
        self.truth.send(Imu(stamp, rate, (GRAVITY * x, GRAVITY * y, GRAVITY * z)))


if __name__ == "__main__":
    from lodeline.process import run

    run(TurnedBoard)
