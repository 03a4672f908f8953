"""What the localiser answers: the pose, how sure it is, and what is wrong with it."""

from typing import NamedTuple

from lodeline.ekf.belief import Covariance3


class Estimate(NamedTuple):
    """Pose in `map` [m, rad] at `stamp_ns`, covariance of (x, y, yaw) row-major.

    `nis` is the squared Mahalanobis distance of the last detection (2 degrees of freedom, 0 before
    the first), `rejected` counts the detections that the gate refused. `ambiguous` says that
    magnets may be, or may have been, taken for their neighbours: 99 % of what the places of bar and
    magnet may be off by reaches half the pitch (and since then, 3 sigma still do), or the cell of
    the pose has less than the probability asked for.
    `certainty` is that probability, as far as it was ever in doubt; the covariance has all
    hypotheses in it. `alarms` counts how often too many magnets were not where they should have
    been, or the robot was tilted as no floor does: it was moved, or is lost, its certainty is 0 and
    stays so. `slipping` says that the wheels turn the robot otherwise than the gyro does,
    `stuck_reed` that a reed stays closed over more way than any magnet is long.
    """

    stamp_ns: int
    x: float
    y: float
    yaw: float
    covariance: Covariance3
    nis: float
    rejected: int
    ambiguous: bool
    certainty: float
    alarms: int
    slipping: bool
    stuck_reed: bool

    @property
    def trouble(self) -> str:
        """What is wrong with it and what to do, or nothing: for people to read."""
        if self.slipping:
            return "INCONSISTENT wheels and gyro: one slips or is silent, or is ill calibrated"
        if self.alarms:
            return "KIDNAPPED magnets or tilt say that the robot was moved: set its pose"
        if self.ambiguous:
            return "AMBIGUOUS the position may be wrong by a pitch of the magnets"
        if self.stuck_reed:
            return "REED_STUCK a reed stays closed: not believed until it opens"
        return ""
