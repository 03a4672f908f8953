"""The register file that most I2C chips are: a pointer that a write sets and a read advances."""

from __future__ import annotations

from collections.abc import Callable

Clock = Callable[[], float]
Vector = tuple[float, float, float]
Sense = Callable[[float], Vector]


class RegisterChip:
    """The first byte written is the pointer; more bytes, or a read, go on from there."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pointer = 0

    def acknowledges(self) -> bool:
        """Chips answer unless they say otherwise."""
        return True

    def write(self, data: bytes) -> None:
        """Set the pointer and write the registers behind it."""
        if not data:
            return
        self._begin(self._clock())
        self._pointer = data[0]
        for value in data[1:]:
            self._set(self._pointer, value)
            self._pointer = self._after(self._pointer)

    def read(self, length: int) -> bytes:
        """Read registers from the pointer on; all of them belong to one moment."""
        self._begin(self._clock())
        got = bytearray()
        for _ in range(length):
            got.append(self._get(self._pointer))
            self._pointer = self._after(self._pointer)
        return bytes(got)

    def _begin(self, now: float) -> None:
        """Bring the chip up to the time `now` [s] before a transaction."""
        raise NotImplementedError

    def _get(self, register: int) -> int:
        raise NotImplementedError

    def _set(self, register: int, value: int) -> None:
        raise NotImplementedError

    def _after(self, register: int) -> int:
        return (register + 1) & 0xFF


def int16(value: float) -> int:
    """Round and clip to what 16 bits hold, as a converter at its stop does."""
    return max(-32768, min(32767, round(value)))
