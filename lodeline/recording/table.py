"""Tables: one CSV file for each key, exact to the last bit."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from lodeline.recording import RecordingError
from lodeline_msgs import Message, columns, row


class Tables:
    """CSV files in `folder`, one for each of `types` (key to class); a context manager.

    `imu/data` goes to `imu_data.csv`: a header, then one row for each message in the order of
    `write`. A key without a message has a header alone.
    """

    def __init__(self, folder: Path, types: Iterable[tuple[str, type[Message]]]) -> None:
        self._files = ExitStack()
        self._writers: dict[str, Any] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for key, cls in types:
                file = folder / f"{key.replace('/', '_')}.csv"
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._files.close()
