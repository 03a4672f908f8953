"""When a process that died is started again, and when no more."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from lodeline.pipeline.model import Restart


@dataclass(frozen=True, slots=True)
class BackoffParams:
    """Delays double from `first` to `longest`; `limited` processes get `count` in `window`.

    A process that had been ready for `settled` is started again at once.
    """

    first: Annotated[float, "s"] = 0.1
    longest: Annotated[float, "s"] = 5.0
    jitter: Annotated[float, "1"] = 0.2
    settled: Annotated[float, "s"] = 10.0
    count: int = 5
    window: Annotated[float, "s"] = 60.0


class Backoff:
    """The patience one has with one process. Times are seconds on any steady clock.

    `uniform(a, b)` draws the jitter, so that processes that fell together do not rise together.
    """

    def __init__(
        self, restart: Restart, params: BackoffParams, uniform: Callable[[float, float], float]
    ) -> None:
        self._restart = restart
        self._params = params
        self._uniform = uniform
        self._restarts: deque[float] = deque(maxlen=params.count)
        self._in_a_row = 0

    def after_exit(self, now: float, ready_for: float) -> float | None:
        """Seconds to wait before the next start, or None if there is to be none.

        `ready_for` says how long the process that just ended had been ready.
        """
        params = self._params
        if self._restart == "never":
            return None
        used_up = len(self._restarts) == params.count
        if self._restart == "limited" and used_up and now - self._restarts[0] < params.window:
            return None
        self._restarts.append(now)
        if ready_for >= params.settled:
            self._in_a_row = 0
            return 0.0
        delay = min(params.longest, params.first * 2.0 ** min(self._in_a_row, 30))
        self._in_a_row += 1
        return delay * self._uniform(1.0 - params.jitter, 1.0 + params.jitter)
