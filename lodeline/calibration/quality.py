"""What a calibration says about itself: a verdict in words, or a refusal with the reason."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lodeline.rotation import Vector

if TYPE_CHECKING:
    from numpy.typing import NDArray


class CalibrationRefusedError(ValueError):
    """These readings do not make a calibration; the text says why and what to do."""


def checked(readings: Sequence[Vector], fewest: int, what: str) -> "NDArray[Any]":
    """The readings as an (n, 3) array. Refuses fewer than `fewest` or any non-finite number."""
    import numpy as np

    points = np.asarray(readings, dtype=float).reshape(-1, 3)
    if len(points) < fewest:
        raise CalibrationRefusedError(
            f"{len(points)} {what} readings are too few, take {fewest} or more"
        )
    if not np.isfinite(points).all():
        raise CalibrationRefusedError(f"a {what} reading is not finite")
    return points
