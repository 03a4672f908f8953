"""A model of an I2C bus: chips at addresses, and silence (errno 121) everywhere else."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Sequence
from typing import Protocol

from lodeline.sim.adapter import Message


class Chip(Protocol):
    """A chip as the bus sees it. A fault is injected by a chip that wraps another one."""

    def acknowledges(self) -> bool:
        """Tell whether the chip answers its address now."""

    def write(self, data: bytes) -> None:
        """Take the bytes that follow the address in a writing message."""

    def read(self, length: int) -> bytes:
        """Return exactly `length` bytes for a reading message."""


class BusModel:
    """Routes messages to chips by their 7-bit address; one transaction at a time."""

    def __init__(self, lock: threading.RLock | None = None) -> None:
        self._chips: dict[int, Chip] = {}
        self._lock = lock if lock is not None else threading.RLock()

    def attach(self, address: int, chip: Chip) -> None:
        """Put a chip at an address (0x08 to 0x77), in place of the one that was there."""
        if not 0x08 <= address <= 0x77:
            raise ValueError(f"0x{address:02x} is no 7-bit I2C address for a chip")
        with self._lock:
            self._chips[address] = chip

    def detach(self, address: int) -> Chip:
        """Take a chip off the bus, as a pulled plug does, and return it."""
        with self._lock:
            return self._chips.pop(address)

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        """Carry out one combined transaction; OSError 121 at the first unanswered address."""
        answers = []
        with self._lock:
            for message in messages:
                chip = self._chips.get(message.address)
                if chip is None or not chip.acknowledges():
                    raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
                if message.read:
                    answers.append(chip.read(message.length))
                else:
                    chip.write(message.data)
        return answers
