"""A bar of reed switches: which reeds are closed, as lateral offsets of the magnets under it.

Source: the magnet lab, "the magnet sensor measurements": adjacent closed reeds see one magnet,
which is under the middle of the group; two groups are two magnets.
"""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class ReedBarParams:
    """`reeds` switches, `pitch` apart, on a line parallel to the axle and centred on the robot."""

    reeds: Annotated[int, "1"] = 8
    pitch: Annotated[float, "m"] = 0.010

    def __post_init__(self) -> None:
        if self.reeds < 1:
            raise ValueError(f"a bar has at least 1 reed, not {self.reeds}")
        if not self.pitch > 0.0:
            raise ValueError(f"the pitch of the reeds must be positive, not {self.pitch} m")


class ReedBar:
    """Reads words of closed reeds: bit 0 is reed 1, the rightmost; a set bit is a closed reed."""

    def __init__(self, params: ReedBarParams) -> None:
        self._params = params
        self._middle = 0.5 * (params.reeds + 1)
        self._mask = (1 << params.reeds) - 1

    def laterals(self, closed: int) -> tuple[float, ...]:
        """Lateral offsets [m], + left, of the magnets, from right to left.

        Reed n is at pitch * (n - middle), where the middle of 8 reeds is 4.5.
        Bits beyond the last reed are not looked at.
        """
        offsets = []
        word, reed = closed & self._mask, 1
        while word:
            if word & 1:
                first = reed
                while word & 2:
                    word >>= 1
                    reed += 1
                offsets.append(self._params.pitch * (0.5 * (first + reed) - self._middle))
            word >>= 1
            reed += 1
        return tuple(offsets)
