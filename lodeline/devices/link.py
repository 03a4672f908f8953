"""A device's link to its bus: retries, health, and bringing a lost device up again.

A device is brought up by a row of stages (identify, reset, configure), each of which says how
long to wait before the next one; nothing here sleeps, and the time is handed in. A transaction is
tried three times; after ten failed reads in a row the device counts as gone, and every 0.2 to
0.5 s the bus is opened again and the device brought up afresh.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

from lodeline.i2c import Bus, BusError

Result = TypeVar("Result")

RETRIES = 2
GONE_AFTER = 10  # failed reads in a row
HUNG_AFTER = 3  # timeouts in a row: each holds the work loop for the adapter's timeout
ABSENT_AFTER = 3  # times that a device was looked for in vain
RETRY_FIRST = 0.2  # s
RETRY_LAST = 0.5  # s, so that a device that returns delivers within a second

STATES = {"ok": "running", "degraded": "degraded", "fault": "fault"}
"""What a node says of itself, by the state of its device."""


class DeviceError(Exception):
    """The chip that answers is not the one declared, or does not do what it is told."""

    exit_code = 69  # of the process that cannot do without: EX_UNAVAILABLE


@dataclass(slots=True)
class Health:
    """How a device does. `message` is the last thing worth telling, `events` counts them.

    A degraded one can be used, less well; one at fault delivers nothing.
    """

    state: Literal["ok", "degraded", "fault"] = "fault"
    message: str = ""
    events: int = 0
    retried: int = 0  # transactions that a retry saved
    failed: int = 0  # reads that were lost
    recovered: int = 0  # times the device was brought up again

    def tell(self, message: str) -> None:
        """Note a message for people."""
        self.message = message
        self.events += 1


class Link:
    """Keeps one device of a bus usable, or trying."""

    def __init__(
        self, name: str, bus: Bus, address: int, stages: Sequence[Callable[[], float]]
    ) -> None:
        self.health = Health()
        self._name = name
        self._bus = bus
        self._address = address
        self._stages = stages
        self._stage = 0
        self._was_up = False
        self._sought = 0
        self._reopen = bus.fd is None
        self._failures = 0
        self._next_s = float("-inf")
        self._pause = RETRY_FIRST

    @property
    def up(self) -> bool:
        """Whether the device was brought up and has not been lost since."""
        return self._stage == len(self._stages)

    @property
    def absent(self) -> bool:
        """Whether the device was looked for at least three times and never there."""
        return self._sought >= ABSENT_AFTER and not self._was_up

    def ready(self, now_s: float) -> bool:
        """Tell whether the device may be read at `now_s` [s]; if not, carry on bringing it up."""
        while self._stage < len(self._stages):
            if now_s < self._next_s:
                return False
            try:
                wait = self._next_stage(now_s)
            except (OSError, DeviceError) as error:
                self._not_up(now_s, error)
                return False
            self._stage += 1
            self._next_s = now_s + wait
            if self._stage == len(self._stages):
                self._up()
        return now_s >= self._next_s

    def attempt(self, now_s: float, transaction: Callable[[], Result]) -> Result | None:
        """Return what the transaction returns, or None if it failed three times."""
        for tried in range(RETRIES + 1):
            try:
                self._check_hung(now_s)
                result = transaction()
            except OSError as error:
                failure = error
                if error.errno == errno.ETIMEDOUT:
                    self._bus.hung_s = now_s
                    break
            else:
                self._failures = 0
                if tried:
                    self.health.retried += 1
                    number = last_errno(failure)
                    self.health.tell(f"I2C_NACK {self._name}: 1 read failed ({number}), retried")
                return result
        self._failed(now_s, failure)
        return None

    def _next_stage(self, now_s: float) -> float:
        self._check_hung(now_s)
        try:
            if self._reopen:
                self._bus.reopen()
                self._reopen = False
            return self._stages[self._stage]()
        except OSError as error:
            if error.errno == errno.ETIMEDOUT:
                self._bus.hung_s = now_s
            raise

    def _check_hung(self, now_s: float) -> None:
        """A bus that hung in this tick is not waited for again: that would stop the work loop."""
        if self._bus.hung_s == now_s:
            raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))

    def lost(self, now_s: float, message: str) -> None:
        """Bring the device up again from `now_s` on: it answers, but forgot its settings."""
        self.health.tell(message)
        self._stage = 0
        self._next_s = now_s

    def _failed(self, now_s: float, error: OSError) -> None:
        self.health.failed += 1
        self._failures += 1
        hung = error.errno == errno.ETIMEDOUT
        if self._failures >= (HUNG_AFTER if hung else GONE_AFTER):
            self._stage = 0
            self._pause = RETRY_FIRST
            self._not_up(now_s, error)

    def _not_up(self, now_s: float, error: OSError | DeviceError) -> None:
        text = str(error) if isinstance(error, DeviceError) else self._gone(error)
        if self.health.state != "fault" or self.health.message != text:
            self.health.tell(text)
        self.health.state = "fault"
        self._sought += 1
        self._reopen = True
        self._stage = 0
        self._failures = 0
        self._next_s = now_s + self._pause
        self._pause = min(2.0 * self._pause, RETRY_LAST)

    def _up(self) -> None:
        if self._was_up:
            self.health.recovered += 1
        if self.health.events and self.health.state == "fault":
            self.health.tell(f"I2C_BACK {self._name}: answers again")
        self._was_up = True
        self._failures = 0
        self._pause = RETRY_FIRST
        self.health.state = "ok"

    def _gone(self, error: OSError) -> str:
        if isinstance(error, BusError):
            return f"I2C_BUS {self._name}: {error.strerror}"
        bus = f"bus {self._bus.where}"
        if error.errno == errno.ETIMEDOUT:
            return f"I2C_HANG {self._name}: {bus} does not come free - power-cycle the sensor"
        where = f"no answer at 0x{self._address:02x} on {bus}"
        return f"I2C_GONE {self._name}: {where} ({last_errno(error)}) - check cable and power"


def last_errno(error: OSError) -> str:
    """Return how people look an I2C error up."""
    return f"errno {error.errno}"
