"""Recordings: MCAP files of packed messages, imports into them, replays out of them."""


class RecordingError(Exception):
    """A recording, or a text to import, that cannot be used; the text says why and what to do."""
