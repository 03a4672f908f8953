"""Tables of sensor readings: CSV files, plain or gzipped, whose columns are found by name.

`t_s` [s], `gx gy gz` [rad/s], `ax ay az` [m/s^2, specific force], `mx my mz` [uT]; the order is
free, other columns are left alone, `#` begins a line of comment. `;` or a tab may stand for the
comma, and a comma then for the decimal point. What is wrong is told with file and line. Microtesla
become tesla here and nowhere else.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import NamedTuple, NoReturn, Self

from lodeline.recording import RecordingError, unreadable
from lodeline.rotation import Vector

TIME = "t_s"
GYRO, ACCEL, MAG = ("gx", "gy", "gz"), ("ax", "ay", "az"), ("mx", "my", "mz")
MICROTESLA = 1e-6
GZIP_MAGIC = b"\x1f\x8b"
HEADER_BYTES = 4096  # among which the names of the columns are looked for
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
Cells = tuple[float | None, ...]


class ImuRow(NamedTuple):
    """One row in SI; the field is None where its cells are empty, so are single extra cells."""

    line: int
    t: float
    angular_velocity: Vector
    linear_acceleration: Vector
    magnetic_field: Vector | None
    extra: Cells


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
            self._lines = self._read(self._delimiter)
            self._point = ""  # what the numbers have, as soon as one has it: `.` or `,`
            line, header = next(self._lines, (0, None))
            if header is None:
                raise RecordingError(f"{file}: is empty, expected a header with {TIME}, gx, ...")
            if all(_is_number(cell) for cell in header):
                self.fail(line, "numbers, expected the names of the columns in the first row")
            self.columns = tuple(cell.strip() for cell in header)
        except BaseException:
            self._stream.close()
            raise

    def cells(self) -> Iterator[tuple[int, list[str]]]:
        """(line, cells) of each row, unread."""
        return self._lines

    def rows(
        self, needed: Sequence[str], wanted: Sequence[str] = ()
    ) -> Iterator[tuple[int, Cells]]:
        """(line, numbers) of each row: the needed columns, then the wanted ones.

        A number is None where the cell is empty or `nan`, or there is no such column: that is for
        wanted columns only.
        """
        places = [self._place(name) for name in needed]
        places += [self._place(name) if name in self.columns else -1 for name in wanted]
        names = [*needed, *wanted]
        for line, cells in self._lines:
            if len(cells) != len(self.columns):
                text = f"{len(cells)} columns, the header has {len(self.columns)}"
                if self._delimiter == "," and len(cells) > len(self.columns):
                    text += "; if these are decimal commas, write points, or `;` between columns"
                self.fail(line, text)
            numbers = tuple(
                None if place < 0 else self._number(line, name, cells[place])
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

    def _number(self, line: int, name: str, cell: str) -> float | None:
        if not (text := cell.strip()) or text.lower() == "nan":
            return None
        if self._delimiter != ",":
            text = self._pointed(line, name, text)
        try:
            number = float(text)
        except ValueError:
            number = float("inf")
        if not isfinite(number):
            with_point = " with a decimal point" if DECIMAL_COMMA.fullmatch(text) else ""
            self.fail(line, f"{name} is {text[:40]!r}, expected a number{with_point}")
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
        reader = csv.reader(self._stream, delimiter=delimiter)
        while True:
            try:
                cells = next(reader, None)
            except UnicodeDecodeError:
                raise RecordingError(f"{self.file}: is no text, expected CSV") from None
            except (EOFError, OSError, csv.Error, zlib.error) as error:
                self.fail(reader.line_num + 1, f"cannot be read on: {error}")
            if cells is None:
                return
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                yield reader.line_num, cells

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def read_imu(table: CsvTable, extra: Sequence[str] = ()) -> Iterator[ImuRow]:
    """Rows of inertial and, if there, magnetic readings; time may stand still but not go back."""
    missing = [name for name in MAG if name not in table.columns]
    if 0 < len(missing) < len(MAG):
        table.fail(1, f"no column {missing[0]}, but others of {', '.join(MAG)}")
    last = None
    for line, numbers in table.rows((TIME, *GYRO, *ACCEL), (*MAG, *extra)):
        t, gx, gy, gz, ax, ay, az, *others = numbers
        mx, my, mz, *rest = others
        assert t is not None  # needed columns are never None
        assert gx is not None and gy is not None and gz is not None
        assert ax is not None and ay is not None and az is not None
        if last is not None and t < last:
            table.fail(line, f"time goes back: {TIME} is {t:g} after {last:g}")
        last = t
        field = None
        if mx is not None and my is not None and mz is not None:
            field = (mx * MICROTESLA, my * MICROTESLA, mz * MICROTESLA)
        yield ImuRow(line, t, (gx, gy, gz), (ax, ay, az), field, tuple(rest))


def _is_number(cell: str) -> bool:
    try:
        return isfinite(float(cell))
    except ValueError:
        return not cell.strip()


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
    return io.TextIOWrapper(data, encoding="utf-8-sig", newline=""), delimiter
