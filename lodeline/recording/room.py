"""How much room the disk of a recording has left, and when that is too little."""

from __future__ import annotations

import os
import time
from pathlib import Path

LITTLE = 1_000_000_000
"""Bytes left of which a word is said."""
RESERVE = 200_000_000
"""Bytes left to all others on the disk: a recording stops before it takes these."""
SOON_S = 300.0
LOOK_S = 10.0
"""No rate is known before."""


class Room:
    """The room on the disk of a folder; `look` now and then.

    `gone` says that only the reserve is left. Whoever begins on a disk that has no more than that
    means to fill it, and may.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._fills = _free(folder) <= RESERVE
        self._begun = time.monotonic()
        self._told = False
        self.gone = False
        self.news = ""

    def look(self, written: int) -> None:
        """See how much is left, with so many bytes written since the start; `news` is said once."""
        left = _free(self._folder)
        self.gone |= left < RESERVE and not self._fills
        elapsed = time.monotonic() - self._begun
        lasts = left * elapsed / written if written and elapsed > LOOK_S else float("inf")
        self.news = ""
        if not self._told and (left < LITTLE or lasts < SOON_S):
            self._told = True
            soon = f", enough for {lasts / 60.0:.1f} min" if lasts < SOON_S else ""
            self.news = f"DISK_LOW {left / 1e6:.0f} MB left on the disk of {self._folder}{soon}"


def _free(folder: Path) -> int:
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize
