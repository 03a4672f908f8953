"""Dead reckoning by an IMU alone."""

from lodeline.dead_reckoning.inertial import (
    DeadReckoning,
    DeadReckoningEstimate,
    DeadReckoningParams,
    DeadReckoningState,
)

__all__ = ["DeadReckoning", "DeadReckoningEstimate", "DeadReckoningParams", "DeadReckoningState"]
