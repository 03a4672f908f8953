"""Rows of numbers in a text without a header: cells apart by blanks or commas, `#` a comment."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from lodeline.recording import RecordingError, unreadable

# A comma within a number, where blanks or semicolons stand between the numbers.
_DECIMAL_COMMA = re.compile(r"\d,\d+(\s*;\s*|\s+)[^\s,;]")


def rows(file: Path, expected: str) -> Iterator[tuple[int, list[str]]]:
    """(line, cells) of each row, at least one; RecordingError says what was `expected`."""
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise unreadable(file, error) from None
    except UnicodeDecodeError:
        raise RecordingError(f"{file}: is no text, expected {expected}") from None
    found = False
    for line, row in enumerate(text.split("\n"), 1):
        bare = row.partition("#")[0]
        if cells := bare.replace(",", " ").split():
            if _DECIMAL_COMMA.search(bare):
                raise RecordingError(
                    f"{file}:{line}: decimal commas; write points: sed 's/,/./g' {file.name}"
                )
            found = True
            yield line, cells
    if not found:
        raise RecordingError(f"{file}: no rows, expected {expected}")
