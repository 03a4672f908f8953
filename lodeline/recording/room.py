"""How much room the disk of a recording has left, and when that is too little."""

from __future__ import annotations

import os
import time
from pathlib import Path

from lodeline.recording import RecordingError

LITTLE = 1_000_000_000
"""Bytes left of which a word is said."""
RESERVE, SHARE = 200_000_000, 0.1
"""Bytes left to all others on the disk, or this share of a small one: a recording stops before
it takes these.
"""
SOON_S = 300.0
LOOK_S = 10.0
"""No rate is known before."""


class Room:
    """The room on the disk of a folder; `look` now and then. `gone`: only the reserve is left.

    RecordingError if it is so from the beginning.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._begun = time.monotonic()
        self._told = False
        self.gone = False
        self.news = ""
        try:
            disk = os.statvfs(folder)
        except FileNotFoundError:
            raise RecordingError(f"{folder}: there is no such folder: make it first") from None
        except OSError as error:
            raise RecordingError(f"{folder}: cannot be written to: {error.strerror}") from None
        self._reserve = min(RESERVE, round(SHARE * disk.f_blocks * disk.f_frsize))
        left = _free(folder)
        if left < self._reserve:
            raise RecordingError(
                f"DISK_LOW {left / 1e6:.0f} MB left on the disk of {folder}, and {self.spared}: "
                "make room, or record elsewhere by -o"
            )

    @property
    def spared(self) -> str:
        """What is not taken, in words."""
        return f"its last {self._reserve / 1e6:.3g} MB are left to others"

    def look(self, written: int) -> None:
        """See how much is left, with so many bytes written since the start; `news` is said once."""
        left = _free(self._folder)
        self.gone |= left < self._reserve
        elapsed = time.monotonic() - self._begun
        ours = max(0, left - self._reserve)
        lasts = ours * elapsed / written if written and elapsed > LOOK_S else float("inf")
        self.news = ""
        if not self._told and (left < LITTLE or lasts < SOON_S):
            self._told = True
            soon = f", enough for {lasts / 60.0:.1f} min" if lasts < SOON_S else ""
            self.news = f"DISK_LOW {left / 1e6:.0f} MB left on the disk of {self._folder}{soon}"


def _free(folder: Path) -> int:
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize
