"""The square lattice of magnets under the floor."""

import math
from collections.abc import Iterator
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

    def around(self, x: float, y: float, radius: float) -> Iterator[tuple[float, float]]:
        """All magnets within `radius` of (x, y) [m], as (x, y) [m], row by row."""
        pitch = self.pitch
        i_low = math.ceil((x - radius - self.origin_x) / pitch)
        i_high = math.floor((x + radius - self.origin_x) / pitch)
        for i in range(i_low, i_high + 1):
            at_x = self.origin_x + pitch * i
            half = math.sqrt(max(0.0, radius * radius - (at_x - x) ** 2))
            j_low = math.ceil((y - half - self.origin_y) / pitch)
            j_high = math.floor((y + half - self.origin_y) / pitch)
            for j in range(j_low, j_high + 1):
                yield at_x, self.origin_y + pitch * j
