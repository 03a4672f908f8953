"""What an EKF engine does: predict, weigh a detection, correct. Two of them exist.

Equations as in the magnet lab (the form with noisy input); U = (ds, dtheta) of a step:
P <- A P A^T + B Q B^T + Q_alpha, and Y = where the detected magnet is in the robot frame.
"""

from typing import Literal, NamedTuple, Protocol

from lodeline.ekf.belief import Belief
from lodeline.ekf.motion import Delta


class Noise(NamedTuple):
    """Noise of one step: covariance Q of (ds [m], dtheta [rad]) and the variances of Q_alpha."""

    ss: float
    st: float
    tt: float
    position: float = 0.0  # [m^2], each axis
    heading: float = 0.0  # [rad^2]


class Detection(NamedTuple):
    """A magnet seen at (ahead, left) [m] of the robot, with variances [m^2], and where it lies."""

    ahead: float
    left: float
    ahead_variance: float
    left_variance: float
    magnet_x: float
    magnet_y: float


class Innovation(NamedTuple):
    """Measured minus predicted (ahead, left) [m], its covariance S [m^2] and y^T S^-1 y."""

    ahead: float
    left: float
    s00: float
    s01: float
    s11: float
    nis: float


Row = tuple[float, float, float]
"""Derivatives of one measured number by x, y and yaw."""


class Engine(Protocol):
    """Pure functions of beliefs; none of them remembers anything between calls."""

    def predict(self, belief: Belief, delta: Delta, noise: Noise) -> Belief:
        """The belief after a motion."""
        ...

    def weigh(self, belief: Belief, detection: Detection) -> Innovation:
        """How far a detection is from what the belief expects, for the gate."""
        ...

    def correct(self, belief: Belief, detection: Detection) -> Belief:
        """The belief after a detection that passed the gate."""
        ...

    def correct_scalar(self, belief: Belief, row: Row, residual: float, variance: float) -> Belief:
        """The belief after one number: `residual` = `row` . (error of x, y, yaw) + noise."""
        ...


EngineName = Literal["scalar", "filterpy"]
