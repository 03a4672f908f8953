"""Text files of robots that have a format by name: its options, its samples, a recording of it."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from lodeline.recording import RecordingError

if TYPE_CHECKING:  # messages and MCAP are loaded by those who need them
    from lodeline_msgs import Message

    Imported = tuple[list[tuple[str, Message]], str]
    """Samples by key, and what they were made of."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What can be told of a text file besides its format."""
    parser.add_argument(
        "--course",
        action="store_true",
        help="magnet-lab: as the course takes it: rows at rest dropped, 5 Hz, 45 counts a turn",
    )
    parser.add_argument(
        "--cumulative", action="store_true", help="lecture-wheels: counts since the start"
    )
    parser.add_argument(
        "--gravity-sign",
        type=int,
        choices=[1, -1],
        help="lecture-imu: sign of z at rest (default: as the first rows have it)",
    )


def write(imported: Imported, stream: BinaryIO) -> None:
    """The recording of it."""
    from lodeline.recording.write import RecordingWriter

    samples, source = imported
    writer = RecordingWriter(stream, {"clock": "recording", "source": source})
    for key, message in samples:
        writer.write(key, message)
    writer.close()


def _magnet_lab(file: Path, args: argparse.Namespace) -> Imported:
    from lodeline.recording import magnet_lab

    rows = magnet_lab.read_rows(file)
    if args.course:
        try:
            rows = magnet_lab.course_setting(rows)
        except ValueError as error:
            raise RecordingError(f"{file}: {error}") from None
    setting = "course setting" if args.course else "all rows"
    return list(magnet_lab.messages(rows)), f"magnet-lab text {file.name}, {setting}"


def _lecture_wheels(file: Path, args: argparse.Namespace) -> Imported:
    from lodeline.recording import lecture

    _no_lab_file(file)
    samples = lecture.wheels(file, cumulative=args.cumulative)
    counts = "cumulative" if args.cumulative else "incremental"
    return [("wheels", each) for each in samples], f"lecture text {file.name}, {counts}"


def _lecture_imu(file: Path, args: argparse.Namespace) -> Imported:
    from lodeline.recording import lecture

    _no_lab_file(file)
    samples, sign = lecture.imu(file, args.gravity_sign)
    source = f"lecture text {file.name}, gravity sign {sign:+d}"
    return [("imu/data", each) for each in samples], source


def _no_lab_file(file: Path) -> None:
    """The lecture's formats leave further columns alone, and would take the lab's for theirs."""
    from lodeline.recording import magnet_lab

    if magnet_lab.is_one(file):
        columns = f"{magnet_lab.COLUMNS} columns of the magnet lab"
        raise RecordingError(f"{file}: has the {columns}: --format magnet-lab")


FORMATS: dict[str, Callable[[Path, argparse.Namespace], Imported]] = {
    "magnet-lab": _magnet_lab,
    "lecture-wheels": _lecture_wheels,
    "lecture-imu": _lecture_imu,
}
"""By the name of the format, which is also that of the profile that goes with it."""
