"""A clock that was set back: for a while all of its stamps look too old, and are not."""


class Setback:
    """Tells a clock that was set back from single samples that come late, by one row of stamps."""

    def __init__(self, span_ns: int) -> None:
        """`span_ns`: for so long nothing but old stamps may come."""
        self._span_ns = span_ns
        self._since_ns: int | None = None

    def fresh(self) -> None:
        """A stamp came that is not too old."""
        self._since_ns = None

    def old(self, stamp_ns: int) -> bool:
        """One came that is; True when that, and nothing else, has gone on for the span."""
        since = self._since_ns
        if since is None or stamp_ns < since:
            self._since_ns = stamp_ns
            return False
        return stamp_ns - since > self._span_ns
