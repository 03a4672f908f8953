"""The whole robot: a world, what its sensors see of it, and the chips on its bus."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

from lodeline.sim.bus import BusModel
from lodeline.sim.chips.ak8963 import Ak8963Chip, Ak8975Chip
from lodeline.sim.chips.as5048b import As5048bChip
from lodeline.sim.chips.mcp23017 import Mcp23017Chip
from lodeline.sim.chips.mpu import MpuChip
from lodeline.sim.chips.pcf8574 import Pcf8574Chip
from lodeline.sim.params import RobotParams
from lodeline.sim.sensors import Sensors
from lodeline.sim.world import World, WorldState

__all__ = ["RobotParams", "RobotState", "SimulatedRobot", "Truth"]

IMU_ADDRESS = 0x68
MAG_ADDRESS = 0x0C
LEFT_ADDRESS = 0x40
RIGHT_ADDRESS = 0x41
BAR_ADDRESS = 0x20
IDENTITIES = {"mpu9250": 0x71, "mpu9255": 0x73, "mpu9150": 0x68, "mpu6500": 0x70, "mpu6050": 0x68}
COMPASSES = {"mpu9250": Ak8963Chip, "mpu9255": Ak8963Chip, "mpu9150": Ak8975Chip}


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
    power-on. With `waiting` its time stands still until `begin` is called.
    """

    def __init__(
        self,
        params: RobotParams,
        clock: Callable[[], float],
        state: RobotState | None = None,
        *,
        waiting: bool = False,
    ) -> None:
        self._lock = threading.RLock()
        begun = replace(state) if state is not None else RobotState(start=clock())
        self._world = World(params, begun)
        self._clock = clock
        self._start = None if waiting else begun.start
        self.bus = BusModel(self._lock)
        sensors = Sensors(params, self._world)
        now = self.now
        self.imu = MpuChip(
            now,
            sensors.angular_velocity,
            sensors.specific_force,
            sensors.temperature,
            IDENTITIES[params.imu_chip],
            params.imu_clock_error,
        )
        compass = COMPASSES.get(params.imu_chip, Ak8963Chip)
        self.mag = compass(now, sensors.magnetic_field, self.imu.bypassed)
        self.left = As5048bChip(now, lambda t: sensors.encoder_turns(t)[0])
        self.right = As5048bChip(now, lambda t: sensors.encoder_turns(t)[1])
        expander = Mcp23017Chip if params.bar_chip == "mcp23017" else Pcf8574Chip
        self.bar = expander(now, sensors.closed_reeds)
        self.bus.attach(IMU_ADDRESS, self.imu)
        if params.imu_chip in COMPASSES:
            self.bus.attach(MAG_ADDRESS, self.mag)
        self.bus.attach(LEFT_ADDRESS, self.left)
        self.bus.attach(RIGHT_ADDRESS, self.right)
        if params.bar_chip != "none":
            self.bus.attach(BAR_ADDRESS, self.bar)

    def begin(self) -> None:
        """Let time pass from now on, if it does not yet."""
        with self._lock:
            if self._start is None:
                self._start = self._clock()

    def now(self) -> float:
        """Time of the simulation [s]."""
        return 0.0 if self._start is None else self._clock() - self._start

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
            start = self._clock() if self._start is None else self._start
            return RobotState(**{**asdict(self._world.state), "start": start})
