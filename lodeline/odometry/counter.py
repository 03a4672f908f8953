"""Signed differences of free-running counters, roll-over included."""


def count_difference(new: int, old: int, bits: int | None = None) -> int:
    """Counts from `old` to `new`, signed.

    With `bits` both readings are of an n-bit counter that rolls over: the shorter way round is
    taken, so up to half its range may pass between two readings. None: the counter never rolls.
    Raises ValueError for a counter of less than 2 bits.
    """
    if bits is None:
        return new - old
    if bits < 2:
        raise ValueError(f"a counter that rolls over has at least 2 bits, not {bits}")
    half = 1 << (bits - 1)
    return ((new - old + half) & ((1 << bits) - 1)) - half
