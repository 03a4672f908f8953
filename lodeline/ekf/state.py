"""What a localiser saves, so that its successor goes on where it stood."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any

from lodeline.ekf.samples import Motion
from lodeline.ekf.track import Track


@dataclass(frozen=True, slots=True)
class Unused:
    """How many samples were not used, and why."""

    late: int = 0
    duplicates: int = 0
    refused: int = 0


@dataclass(frozen=True, slots=True)
class LocalizerState:
    """The track at `stamp_ns`, and the last odometry before it (None: there was none)."""

    stamp_ns: int
    odometry: Motion | None
    track: Track
    unused: Unused = field(default_factory=Unused)

    def checked(self) -> "LocalizerState":
        """Itself with covariances that are some; ValueError if it holds what no localiser saves."""
        mixture = self.track.mixture
        if not all(map(isfinite, _numbers(self.odometry or ()))):
            raise ValueError("the saved odometry has a number in it that is not finite")
        if not mixture or not all(0.0 < w <= 1.0 and belief.finite for w, belief in mixture):
            raise ValueError("the saved state has a number in it that is not finite")
        if not all(map(isfinite, _numbers(self.track.learned or ()))):
            raise ValueError("what was learned has a number in it that is not finite")
        return replace(self, track=self.track.each(lambda belief: belief.positive()))


def _numbers(values: tuple[Any, ...]) -> Iterator[float]:
    for value in values:
        yield from _numbers(value) if isinstance(value, tuple) else (value,)
