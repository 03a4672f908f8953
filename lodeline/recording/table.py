"""Tables: one CSV file for each key, exact to the last bit."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from lodeline.recording import NoRecordingError, RecordingError
from lodeline_msgs import MESSAGES, Message, columns, from_row, row


class Tables:
    """CSV files in `folder`, one for each of `types` (key to class); a context manager.

    `imu/data` goes to `imu_data.csv` (to `imu__data.csv` beside a key `imu_data`): a header, then
    one row for each message in the order of `write`. A key without a message has a header alone.
    """

    def __init__(self, folder: Path, types: Iterable[tuple[str, type[Message]]]) -> None:
        self._files = ExitStack()
        self._writers: dict[str, Any] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            classes = dict(types)
            for key, name in _names(classes).items():
                file = folder / f"{name}.csv"
                cls = classes[key]
                stream = self._files.enter_context(file.open("w", encoding="utf-8", newline=""))
                self._writers[key] = csv.writer(stream, lineterminator="\n")
                self._writers[key].writerow(columns(cls))
        except OSError as error:
            self._files.close()
            raise RecordingError(f"{folder}: cannot be written: {error.strerror}") from None

    def write(self, key: str, message: Message) -> None:
        """Append a message to the table of its key."""
        self._writers[key].writerow(row(message))

    def __enter__(self) -> Tables:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()


def _names(keys: Iterable[str]) -> dict[str, str]:
    """A file's name for each key, no two the same; a key that is one already has its own."""
    names: dict[str, str] = {}
    for key in sorted(keys, key=lambda each: "/" in each):
        bar = "_"
        while (name := key.replace("/", bar)) in names.values():
            bar += "_"
        names[key] = name
    return names


def read_tables(folder: Path) -> Iterator[tuple[str, Message]]:
    """(name of the file without its ending, message) of every table in a folder, file by file.

    The header tells the class; files of anything else are left alone. RecordingError, with
    `file:line:`, for a row that is none of `Tables`; NoRecordingError where there is no table.
    """
    classes = {tuple(columns(cls)): cls for cls in MESSAGES.values()}
    found = False
    for file in sorted(folder.glob("*.csv")):
        with file.open(encoding="utf-8", newline="") as stream:
            rows = csv.reader(stream)
            try:
                cls = classes.get(tuple(next(rows, ())))
                found = found or cls is not None
                for cells in rows if cls is not None else ():
                    assert cls is not None
                    yield file.stem, from_row(cls, cells)
            except (ValueError, csv.Error) as error:
                raise RecordingError(f"{file}:{rows.line_num}: {error}") from None
    if not found:
        raise NoRecordingError(f"{folder} holds no table that `lodeline replay --csv` wrote")
