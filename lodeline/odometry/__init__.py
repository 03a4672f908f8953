"""Wheel odometry: roll-over counters, differential-drive kinematics, integration."""

from lodeline.odometry.counter import count_difference
from lodeline.odometry.kinematics import DifferentialDrive
from lodeline.odometry.odometry import (
    Odometry,
    OdometryEstimate,
    OdometryParams,
    OdometryState,
)

__all__ = [
    "DifferentialDrive",
    "Odometry",
    "OdometryEstimate",
    "OdometryParams",
    "OdometryState",
    "count_difference",
]
