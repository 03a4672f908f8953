"""The whole robot: a world, what its sensors see of it, and the chips on its bus."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

from lodeline.sim.bus import BusModel
from lodeline.sim.chips.ak8963 import Ak8963Chip
from lodeline.sim.chips.as5048b import As5048bChip
from lodeline.sim.chips.mpu9250 import Mpu9250Chip
from lodeline.sim.chips.pcf8574 import Pcf8574Chip
from lodeline.sim.params import RobotParams
from lodeline.sim.sensors import Sensors, turn_of
from lodeline.sim.world import World, WorldState

__all__ = ["RobotParams", "RobotState", "SimulatedRobot", "Truth"]

IMU_ADDRESS = 0x68
MAG_ADDRESS = 0x0C
LEFT_ADDRESS = 0x40
RIGHT_ADDRESS = 0x41
BAR_ADDRESS = 0x20


class Truth(NamedTuple):
    """Where the robot is [m, rad, yaw in (-pi, pi]] and how it moves [m/s, rad/s]."""

    x: float
    y: float
    yaw: float
    v: float
    w: float


@dataclass(slots=True)
class RobotState(WorldState):
    """The world at one moment, and the time of the clock [s] at which it began."""

    start: float = 0.0


class SimulatedRobot:
    """A robot that moves as its clock goes on; its chips are on `bus`. Any thread may ask.

    `clock` [s] may start anywhere. With a `state` of an earlier robot this one is where that one
    would be by now, for a robot drives on while nobody simulates it; its chips are fresh from
    power-on.
    """

    def __init__(
        self, params: RobotParams, clock: Callable[[], float], state: RobotState | None = None
    ) -> None:
        self._lock = threading.RLock()
        begun = replace(state) if state is not None else RobotState(start=clock())
        self._world = World(params, begun)
        self._clock = clock
        self._start = begun.start
        self.bus = BusModel(self._lock)
        sensors = Sensors(params, self._world)
        now = self.now
        self.imu = Mpu9250Chip(
            now, sensors.angular_velocity, sensors.specific_force, sensors.temperature
        )
        self.mag = Ak8963Chip(now, sensors.magnetic_field, self.imu.bypassed)
        left_sign = -1.0 if params.left_inverted else 1.0
        right_sign = -1.0 if params.right_inverted else 1.0
        self.left = As5048bChip(now, lambda t: turn_of(left_sign * sensors.wheel_angles(t)[0]))
        self.right = As5048bChip(now, lambda t: turn_of(right_sign * sensors.wheel_angles(t)[1]))
        self.bar = Pcf8574Chip(now, sensors.closed_reeds)
        self.bus.attach(IMU_ADDRESS, self.imu)
        self.bus.attach(MAG_ADDRESS, self.mag)
        self.bus.attach(LEFT_ADDRESS, self.left)
        self.bus.attach(RIGHT_ADDRESS, self.right)
        self.bus.attach(BAR_ADDRESS, self.bar)

    def now(self) -> float:
        """Time of the simulation [s]."""
        return self._clock() - self._start

    def truth(self) -> Truth:
        """Return where the robot is now."""
        with self._lock:
            motion = self._world.at(self.now())
        return Truth(motion.x, motion.y, motion.yaw, motion.v, motion.w)

    def command(self, v: float, w: float) -> None:
        """Drive at v [m/s] and w [rad/s] for the next 0.5 s instead of along the course."""
        with self._lock:
            self._world.command(self.now(), v, w)

    @property
    def state(self) -> RobotState:
        """A copy of all there is to save, at this moment."""
        with self._lock:
            self._world.advance(self.now())
            return RobotState(**asdict(self._world.state))
