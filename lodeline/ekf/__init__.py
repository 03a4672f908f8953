"""EKF localisation over a lattice of magnets: odometry predicts, a reed bar corrects."""

from lodeline.ekf.belief import Belief
from lodeline.ekf.landmarks import Fix, Sighting
from lodeline.ekf.localizer import Estimate, Localizer, LocalizerState
from lodeline.ekf.params import LocalizerParams

__all__ = [
    "Belief",
    "Estimate",
    "Fix",
    "Localizer",
    "LocalizerParams",
    "LocalizerState",
    "Sighting",
]
