"""Recordings: MCAP files of packed messages, imports into them, replays out of them."""

from pathlib import Path


class RecordingError(Exception):
    """A recording, or a text to import, that cannot be used; the text says why and what to do."""


class NoRecordingError(RecordingError):
    """There is no such file."""


def unreadable(file: Path, error: OSError) -> RecordingError:
    """What to say of a file that cannot be opened."""
    if isinstance(error, FileNotFoundError):
        return NoRecordingError(f"{file}: there is no such file")
    return RecordingError(f"{file}: {error.strerror or error}")
