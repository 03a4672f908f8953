"""The clock of a driver: a thread that ticks at absolute deadlines, so that no delay adds up."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from lodeline.clock import Clock
from lodeline.node import Driver, Node

Failed = Callable[[Node[Any], BaseException, int], None]
"""The driver, what its tick raised, how often in a row."""

SILENCE_S = 1.0
TOLERATED = 0.1
"""A tick that begins later than by this part of a period is counted."""


class Ticker:
    """Ticks one driver, and notes how late each tick begins.

    One that comes a tenth of a period late is counted; a period late or more, skipped and counted.
    """

    def __init__(
        self, driver: Driver[Any], clock: Clock, lock: threading.RLock, failed: Failed
    ) -> None:
        self._driver = driver
        self._clock = clock
        self._lock = lock
        self._failed = failed
        self._period = 1.0 / driver.params.rate
        self._stop = threading.Event()
        self._last = 0.0
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to tick; a second call changes nothing."""
        if self._thread is None:
            self._last = time.monotonic()
            name = f"tick {self._driver.context.name}"
            self._thread = threading.Thread(target=self._run, name=name, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Let the tick that is under way be the last."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(self._period + 0.1)

    def alive(self) -> bool:
        """Whether it ticked lately, or has not been started."""
        limit = max(SILENCE_S, 3 * self._period)
        return self._thread is None or time.monotonic() - self._last < limit

    def _run(self) -> None:
        driver, clock, lock, period = self._driver, self._clock, self._lock, self._period
        deadline = time.monotonic()
        failures = 0
        while not self._stop.is_set():
            with lock:
                late = time.monotonic() - deadline
                driver.context.lateness.append(late)
                if late > TOLERATED * period:
                    driver.context.reject("late tick")
                try:
                    driver.tick(clock.now())
                    failures = 0
                except (Exception, SystemExit) as error:
                    failures += 1
                    driver.context.reject("exception")
                    driver.context.last_error = f"{type(error).__name__}: {error}"
                    self._failed(driver, error, failures)
            self._last = time.monotonic()
            deadline += period
            if self._last > deadline + period:
                missed = int((self._last - deadline) / period)
                driver.context.rejected["missed tick"] += missed
                deadline += missed * period
            wait = deadline - time.monotonic()
            if wait > 0:
                time.sleep(wait)
