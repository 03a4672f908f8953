"""Import of the magnet lab's text files: wheel counts, reed byte and time, one row per sample.

Fifteen columns without a header: left count, right count, reed byte (a bit is 0 while its reed is
closed), time [s], and eleven that nobody uses. Counts are 360 a wheel turn.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from lodeline.recording import RecordingError
from lodeline.recording.rows import rows
from lodeline_msgs import Message, ReedBar, WheelTicks

COLUMNS = 15
EXPECTED = f"{COLUMNS} columns of numbers"
TELLING_ROWS = 50  # of the beginning, by which the format is told
COURSE_STEP = 4  # every fourth row: 5 Hz
COURSE_COUNTS = 8  # 360 / 45 counts a turn
LARGEST = 1 << 53
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?", re.ASCII)


class Row(NamedTuple):
    """Counts of the wheels, closed reeds (bit n: reed n + 1), and when they were read [ns]."""

    stamp: int
    left: int
    right: int
    closed: int


def read_rows(file: Path) -> list[Row]:
    """Rows of a text file; RecordingError with `file:line:` for the first one malformed.

    Columns stand apart by blanks or commas; `#` begins a comment.
    """
    found: list[Row] = []
    for line, cells in rows(file, EXPECTED):
        try:
            row = _row(cells)
            if found and row.stamp < found[-1].stamp:
                raise ValueError(f"time {cells[3]} goes back, expected a time after the row before")
        except ValueError as error:
            raise RecordingError(f"{file}:{line}: {error}") from None
        found.append(row)
    return found


def is_one(file: Path) -> bool:
    """Whether a text begins as one."""
    try:
        for _, cells in islice(rows(file, EXPECTED), TELLING_ROWS):
            _row(cells)
    except (ValueError, RecordingError):
        return False
    return True


def course_setting(rows: list[Row]) -> list[Row]:
    """The rows as the lab's course takes them: 5 Hz and 45 counts a turn.

    Rows at rest before the first motion (but the last of them, where it starts from) and after
    the last motion go; of the rest every fourth stays. Counts are rounded to multiples of 8, a
    half away from zero, so one profile serves both settings. ValueError if no wheel ever moves.
    """
    moving = [i for i in range(1, len(rows)) if rows[i][1:3] != rows[i - 1][1:3]]
    if not moving:
        raise ValueError("no wheel moves, expected a run with motion in it")
    kept = rows[moving[0] - 1 : moving[-1] + 1 : COURSE_STEP]
    return [row._replace(left=_coarse(row.left), right=_coarse(row.right)) for row in kept]


def messages(rows: list[Row]) -> Iterator[tuple[str, Message]]:
    """(key, message) of the rows. The reeds of a row go before its wheels.

    An estimator then has all that belongs to a stamp when the wheels take it there.
    """
    for seq, row in enumerate(rows):
        yield "reeds", ReedBar(row.stamp, row.closed, seq=seq)
        yield "wheels", WheelTicks(row.stamp, row.left, row.right, seq=seq)


def _coarse(count: int) -> int:
    size = (abs(count) + COURSE_COUNTS // 2) // COURSE_COUNTS * COURSE_COUNTS
    return size if count >= 0 else -size


def _row(cells: list[str]) -> Row:
    if len(cells) != COLUMNS:
        raise ValueError(f"{len(cells)} columns, expected {COLUMNS}")
    numbers = [_number(cell, place) for place, cell in enumerate(cells, 1)]
    left, right = (_whole(numbers[i], cells[i], f"column {i + 1}") for i in (0, 1))
    reeds = _whole(numbers[2], cells[2], "column 3")
    if not 0 <= reeds <= 255:
        raise ValueError(f"column 3: {cells[2]}, expected a reed byte from 0 to 255")
    stamp = int((numbers[3] * 1_000_000_000).to_integral_value())
    if not 0 <= stamp < 1 << 63:
        raise ValueError(f"column 4: {cells[3]}, expected a time of 0 s or more")
    return Row(stamp, left, right, 255 - reeds)


def _number(cell: str, place: int) -> Decimal:
    # Decimal itself would take NaN, underscores and exponents that fill the memory.
    if not _NUMBER.fullmatch(cell):
        raise ValueError(f"column {place}: {cell[:40]!r}, expected a number")
    return Decimal(cell)


def _whole(number: Decimal, cell: str, name: str) -> int:
    if number != number.to_integral_value() or abs(number) > LARGEST:
        raise ValueError(f"{name}: {cell[:40]}, expected a whole number")
    return int(number)
