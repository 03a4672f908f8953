"""A table as a text file, plain or gzipped, whose columns are found by name.

`,`, `;`, a tab or blanks stand between the columns; a comma may then stand for the decimal point.
`#` begins a line of comment; the names may stand in one, as numpy.savetxt writes them. What is
wrong is told with file and line.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import NoReturn, Self

from lodeline.recording import RecordingError, unreadable

GZIP_MAGIC = b"\x1f\x8b"
HEADER_BYTES = 4096  # among which the names of the columns are looked for
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
DATE = re.compile(r"\d{4}-\d\d-\d\d")
ISO_TIME = "a time as 2026-01-31T12:00:00.5Z"
Cells = tuple[float | None, ...]


class CsvTable:
    """A CSV file, open for reading; a context manager. `columns` are the names of its header.

    Raises RecordingError, from here or while iterating, with `file:line:` and what was expected.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        try:
            self._stream, self._delimiter = _open(file)
        except OSError as error:
            raise unreadable(file, error) from None
        try:
            self._comment: list[str] = []  # cells of the last line of comment
            self._lines = self._read(self._delimiter)
            self._point = ""  # what the numbers have, as soon as one has it: `.` or `,`
            line, header = next(self._lines, (0, None))
            if header is None:
                raise RecordingError(
                    f"{file}: is empty, expected a header with the names of its columns"
                )
            if all(_is_number(cell) for cell in header):
                if len(self._comment) != len(header):
                    text = "numbers, expected the names of the columns in the first row"
                    self.fail(
                        line, f"{text} (files of the lab and the lecture are imported by --format)"
                    )
                self._lines = chain([(line, header)], self._lines)
                header = self._comment  # as numpy.savetxt writes them
            self.columns = tuple(cell.strip() for cell in header)
        except BaseException:
            self._stream.close()
            raise

    def cells(self) -> Iterator[tuple[int, list[str]]]:
        """(line, cells) of each row, unread."""
        return self._lines

    def rows(
        self, needed: Sequence[str], wanted: Sequence[str] = (), dated: Collection[str] = ()
    ) -> Iterator[tuple[int, Cells]]:
        """(line, numbers) of each row: the needed columns, then the wanted ones.

        A number is None where the cell is empty or `nan`, or there is no such column: that is for
        wanted columns only. `dated` columns may hold ISO 8601 times: they are seconds since 1970,
        UTC unless the time names another zone.
        """
        places = [self._place(name) for name in needed]
        places += [self._place(name) if name in self.columns else -1 for name in wanted]
        names = [*needed, *wanted]
        for line, cells in self._lines:
            if len(cells) != len(self.columns):
                text = f"{len(cells)} columns, the header has {len(self.columns)}"
                if self._delimiter == "," and len(cells) > len(self.columns):
                    text += "; if these are decimal commas, write points, or `;` between columns"
                if self._delimiter == " ":
                    text += "; its columns are apart by blanks"
                self.fail(line, text)
            numbers = tuple(
                None if place < 0 else self._number(line, name, cells[place], name in dated)
                for name, place in zip(names, places, strict=True)
            )
            if None in numbers[: len(needed)]:
                missing = numbers.index(None)
                cell = cells[places[missing]].strip()
                text = repr(cell) if cell else "empty"
                self.fail(line, f"{names[missing]} is {text}, expected a number")
            yield line, numbers

    def fail(self, line: int, text: str) -> NoReturn:
        """Raise RecordingError about a line of the file."""
        raise RecordingError(f"{self.file}:{line}: {text}")

    def _place(self, name: str) -> int:
        found = [place for place, column in enumerate(self.columns) if column == name]
        if not found:
            self.fail(1, f"no column {name} (columns: {', '.join(self.columns)[:120]})")
        if len(found) > 1:
            self.fail(1, f"column {name} stands twice")
        return found[0]

    def _number(self, line: int, name: str, cell: str, dated: bool) -> float | None:
        if not (text := cell.strip()) or text.lower() == "nan":
            return None
        if dated and DATE.match(text):
            try:
                return _seconds(text)
            except ValueError:
                self.fail(line, f"{name} is {text[:40]!r}, expected {ISO_TIME}")
        if self._delimiter != ",":
            text = self._pointed(line, name, text)
        try:
            number = float(text)
        except ValueError:
            number = float("inf")
        if not isfinite(number):
            with_point = " with a decimal point" if DECIMAL_COMMA.fullmatch(text) else ""
            iso = f" or {ISO_TIME}" if dated else ""
            self.fail(line, f"{name} is {text[:40]!r}, expected a number{with_point}{iso}")
        return number

    def _pointed(self, line: int, name: str, text: str) -> str:
        """A number with its decimal comma as a point; a table has one or the other."""
        point = "," if DECIMAL_COMMA.fullmatch(text) else "." if "." in text else ""
        if point and self._point not in ("", point):
            self.fail(
                line, f"{name} is {text[:40]!r}, but rows before have a decimal {self._point!r}"
            )
        self._point = point or self._point
        return text.replace(",", ".") if point == "," else text

    def _read(self, delimiter: str) -> Iterator[tuple[int, list[str]]]:
        """Lines that hold something, as cells; whatever the file cannot be read for is told."""
        blanks = (" ".join(line.split()) for line in self._stream)
        reader = csv.reader(blanks if delimiter == " " else self._stream, delimiter=delimiter)
        while True:
            try:
                cells = next(reader, None)
            except UnicodeDecodeError:
                raise RecordingError(f"{self.file}: is no text, expected CSV") from None
            except (EOFError, OSError, csv.Error, zlib.error) as error:
                self.fail(reader.line_num + 1, f"cannot be read on: {error}")
            if cells is None:
                return
            if any(cell.strip() for cell in cells):
                if not cells[0].lstrip().startswith("#"):
                    yield reader.line_num, cells
                else:
                    self._comment = [cells[0].lstrip(" #"), *cells[1:]]
                    if not self._comment[0]:  # `# t x y`, apart by blanks
                        del self._comment[0]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def _is_number(cell: str) -> bool:
    try:
        return isfinite(float(cell))
    except ValueError:
        return not cell.strip()


def _seconds(text: str) -> float:
    """Seconds since 1970 of an ISO 8601 time; ValueError if it is none."""
    when = datetime.fromisoformat(text)
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def _open(file: Path) -> tuple[io.TextIOWrapper, str]:
    """The text of a file, and what stands between its columns."""
    stream = file.open("rb")
    packed = stream.peek(2)[:2] == GZIP_MAGIC
    data = gzip.GzipFile(fileobj=stream) if packed else stream
    try:
        start = data.peek(HEADER_BYTES)[:HEADER_BYTES].decode("utf-8-sig", "replace")
    except (EOFError, OSError, zlib.error):
        start = ""  # told with its line when it is read
    header = next((line for line in start.splitlines() if not line.startswith("#")), "")
    delimiter = max(",;\t", key=header.count)
    if delimiter not in header and " " in header.strip():
        delimiter = " "
    return io.TextIOWrapper(data, encoding="utf-8-sig", newline=""), delimiter
