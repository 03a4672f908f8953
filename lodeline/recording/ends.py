"""The two ends of an MCAP file: they tell what it is, and whether it was closed and is sound."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from lodeline.recording import RecordingError, unreadable

MAGIC = b"\x89MCAP0\r\n"
_END = struct.Struct("<BQQQI8s")  # footer: opcode, length, summary, offsets, CRC; then the magic
_CRC_BYTES = 4


def check_ends(path: Path) -> None:
    """RecordingError unless the file begins as MCAP files do, and its end is there and sound."""
    try:
        with path.open("rb") as stream:
            head = stream.read(len(MAGIC))
            size = stream.seek(0, 2)
            stream.seek(max(0, size - _END.size))
            end = stream.read()
            if head != MAGIC:
                raise RecordingError(
                    f"{path} is no MCAP recording (a text file of a robot goes through "
                    "`lodeline bag import`)"
                )
            if len(end) < _END.size or not end.endswith(MAGIC):
                raise RecordingError(f"{path} is cut off: it was never closed; {way_out(path)}")
            _, _, start, _, crc, _ = _END.unpack(end)
            # The library trusts the summary: a flipped bit there would hide or rename a key.
            if crc:
                stream.seek(min(start, size))
                summary = stream.read()[: -len(MAGIC) - _CRC_BYTES]
                if zlib.crc32(summary) != crc:
                    raise RecordingError(f"{path} has a damaged index; {way_out(path)}")
    except OSError as error:
        raise unreadable(path, error) from None


def way_out(path: Path) -> str:
    """What to do about a recording that cannot be read."""
    return f"save what is whole by `lodeline bag recover {path} -o NEW.mcap`"
