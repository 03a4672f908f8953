"""Noise that depends on nothing but seed, stream and index.

The same index gives the same value whenever and however often it is asked for, so there is no
generator whose state would have to be saved, and no reading that disturbs another one.
"""

from __future__ import annotations

from math import cos, log, pi, sin, sqrt

_MASK = (1 << 64) - 1


def _mix(z: int) -> int:
    """Scramble 64 bits: the finaliser of SplitMix64 (Steele, Lea and Flood 2014)."""
    z = (z + 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


class Noise:
    """One stream of independent pairs of standard normal numbers."""

    __slots__ = ("_key",)

    def __init__(self, seed: int, stream: int) -> None:
        self._key = _mix(_mix(seed & _MASK) ^ stream)

    def pair(self, index: int) -> tuple[float, float]:
        """Return two independent standard normal numbers (Box and Muller)."""
        z = _mix(self._key ^ (index & _MASK))
        radius = sqrt(-2.0 * log(((z >> 32) + 1) / 4294967296.0))
        angle = 2.0 * pi * (z & 0xFFFFFFFF) / 4294967296.0
        return radius * cos(angle), radius * sin(angle)

    def triple(self, index: int) -> tuple[float, float, float]:
        """Return three independent standard normal numbers."""
        a, b = self.pair(2 * index)
        c, _ = self.pair(2 * index + 1)
        return a, b, c
