"""EKF localisation: odometry predicts; magnets, landmarks and an IMU correct.

`Localizer` is the face to the outside. A sample that it lets in goes into the `history`, which
replays in the order of stamps; each step is one of the `tracker`, from `track` to `track`:

* motion: `mover` predicts along the odometry, with the `gyro` (`turning`, `agreement`);
* measurement: `bar` (what `reeds` tell), `compass`, `landmarks`;
* association: which magnet a sight belongs to; the `mixture` while that is not clear;
* `learned`, `learning`: constants of the robot as further states, where they are asked for;
* history: late samples are put in their place.

The equations stand in the engines; `belief` is what they work on.
"""

from lodeline.ekf.belief import Belief
from lodeline.ekf.estimate import Estimate
from lodeline.ekf.localizer import Localizer
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.samples import Sighting, sightings
from lodeline.ekf.state import LocalizerState

__all__ = [
    "Belief",
    "Estimate",
    "Localizer",
    "LocalizerParams",
    "LocalizerState",
    "Sighting",
    "sightings",
]
