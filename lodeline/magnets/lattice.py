"""The square lattice of magnets under the floor."""

import math
from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class Lattice:
    """Magnets at (origin_x + i pitch, origin_y + j pitch) in `map` [m], for all integers i, j."""

    pitch: Annotated[float, "m"] = 0.055
    origin_x: Annotated[float, "m"] = 0.0
    origin_y: Annotated[float, "m"] = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.pitch) and self.pitch > 0.0):
            raise ValueError(f"the pitch of the magnets must be positive, not {self.pitch} m")

    def nearest(self, x: float, y: float) -> tuple[float, float]:
        """The magnet nearest to (x, y) [m], as (x, y) [m]."""
        pitch = self.pitch
        return (
            self.origin_x + pitch * round((x - self.origin_x) / pitch),
            self.origin_y + pitch * round((y - self.origin_y) / pitch),
        )
