"""A robot to try everything on: drives over the magnet floor, serves its sensors as I2C devices."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from lodeline.node import Driver, Input, Output
from lodeline.sim.robot import RobotParams, RobotState, SimulatedRobot
from lodeline.sim.server import I2cServer
from lodeline_msgs import Odometry, Twist

# What a truth says behind its numbers: no covariances, a speed of the moment.
EXACT = ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), 0.0)


@dataclass(frozen=True, slots=True)
class SimulatorParams:
    """How often the truth is told, and what the robot and its floor are like."""

    rate: Annotated[float, "Hz"] = 50.0
    robot: RobotParams = field(default_factory=RobotParams)


class Simulator(Driver[SimulatorParams]):
    """Follows its course by itself until someone commands it."""

    State = RobotState
    cmd_vel = Input(Twist, queue=1, max_age=0.5)
    truth = Output(Odometry)

    def setup(self) -> None:
        self.serve(None)

    def serve(self, state: RobotState | None) -> None:
        self.robot = SimulatedRobot(
            self.params.robot, self.context.monotonic, state, waiting=state is None
        )
        self.server = I2cServer(self.robot.bus, self.context.sim_socket)

    def close(self) -> None:
        self.server.close()

    def save(self) -> RobotState:
        return self.robot.state

    def resume(self, state: RobotState) -> None:
        self.server.close()
        self.serve(state)

    @cmd_vel.handler
    def on_cmd_vel(self, command: Twist) -> None:
        self.robot.command(command.v, command.w)

    def tick(self, stamp: int) -> None:
        self.robot.begin()
        self.truth.send(Odometry(stamp, *self.robot.truth(), *EXACT))


if __name__ == "__main__":
    from lodeline.process import run

    run(Simulator)
