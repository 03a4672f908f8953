"""Calibrations on file: a YAML that is whole or not there, and the version before it.

A section for each sensor: its parameters, and `date`, `chip`, `source`, `residual`, `verdict`. The
first line holds a checksum of the rest, so that a damaged file is known as such; a file written by
hand has no such line and is taken as it is. The version before lies beside it as NAME.prev.
"""

from __future__ import annotations

import json
import os
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from shlex import quote
from typing import Any, TypeVar

from lodeline.calibration import ImuCalibration
from lodeline.odometry import OdometryParams

C = TypeVar("C", bound=ImuCalibration | OdometryParams)
Section = dict[str, Any]

HEAD = re.compile(rb"# lodeline calibration, crc32 ([0-9a-f]{8})\n")
HEAD_WORDS = (b"lodeline calibration", b"crc32")  # one of them is left of a damaged first line
SECTIONS = ("gyro", "accel", "mag", "wheels")


class CalibrationFileError(Exception):
    """No calibration can be had from a file: CAL_MISSING, CAL_CORRUPT or CAL_OTHER begins the text.

    Or none can be put there: the text says why.
    """


class OtherSensorError(ValueError):
    """The calibration was made for another sensor than the one that the parameters name."""


@dataclass(frozen=True, slots=True)
class Loaded:
    """Sections by name, and what had to be done to get them ("" if nothing)."""

    sections: dict[str, Section]
    note: str = ""


def previous(file: Path) -> Path:
    """Where the version before lies."""
    return file.with_name(f"{file.name}.prev")


def load(file: Path) -> Loaded:
    """The newest complete version; CalibrationFileError if there is none."""
    try:
        return Loaded(_read(file))
    except (OSError, ValueError) as error:
        missing = isinstance(error, FileNotFoundError)
        why = "missing" if missing else str(error)
    try:
        kept = _read(previous(file))
    except (OSError, ValueError):
        word = "CAL_MISSING" if missing else "CAL_CORRUPT"
        reason = "" if missing else f" ({why})"
        raise CalibrationFileError(
            f"{word} {file.absolute()}{reason}: run `lodeline calibrate gyro -o {file}`"
        ) from None
    date = max((str(section.get("date", "?")) for section in kept.values()), default="?")
    return Loaded(kept, f"CAL_CORRUPT {file} ({why}), using the version of {date}")


def store(file: Path, name: str, section: Section) -> None:
    """Put a section into the file, beside those that it has; all of it or nothing.

    The file as it was becomes NAME.prev if it was whole. CalibrationFileError if it cannot be
    written.
    """
    try:
        _store(file, name, section)
    except OSError as error:
        raise CalibrationFileError(f"{file}: cannot be written: {error.strerror}") from None


def _store(file: Path, name: str, section: Section) -> None:
    try:
        sections = dict(load(file).sections)
    except CalibrationFileError:
        sections = {}
    sections[name] = section
    try:
        _read(file)
    except (OSError, ValueError):
        pass  # what is damaged shall not take the place of a version that is not
    else:
        _replace(previous(file), file.read_bytes())
    body = "".join(map(_text, sections.items())).encode()
    _replace(file, b"# lodeline calibration, crc32 %08x\n" % zlib.crc32(body) + body)


def calibrated(params: C, file: str) -> tuple[C, str]:
    """The parameters with those of a file in their place, and a note if it was not whole.

    Without a name of a file, the parameters as they are. CalibrationFileError for a file that is
    missing, damaged, of another sensor than `params.chip`, or says what makes no sense.
    """
    if not file:
        return params, ""
    path = Path(file).expanduser()
    loaded = load(path)
    try:
        return _with_sections(params, loaded.sections), loaded.note
    except OtherSensorError as error:
        raise CalibrationFileError(f"CAL_OTHER {path}: {error}") from None
    except ValueError as error:
        raise CalibrationFileError(f"CAL_CORRUPT {path}: {error}") from None


def calibrated_by(params: C, data: bytes) -> C:
    """The parameters with those of a file that holds `data` in their place.

    ValueError if that is damaged, of another sensor, or says what makes no sense.
    """
    return _with_sections(params, _parsed(data, "the calibration"))


def _with_sections(params: C, sections: Mapping[str, Section]) -> C:
    from lodeline.params import build

    # Chips have no number that could be read: people name them, here and in the file.
    chip = getattr(params, "chip", "")
    for name, section in sections.items():
        if chip and name != "wheels" and section.get("chip") != chip:
            made_for = section.get("chip", "not told")
            raise OtherSensorError(
                f"{name} was made for the chip {made_for!r}, this is {chip!r}: "
                f"run `lodeline calibrate {name} --chip {quote(chip)}`"
            )
    known = {item.name for item in fields(params)} - {"chip"}
    values = {
        name: value
        for section in sections.values()
        for name, value in section.items()
        if name in known
    }
    made, problems = build(type(params), values)
    if made is None:
        raise ValueError(problems[0].text)
    return replace(params, **{name: getattr(made, name) for name in values})


def _read(file: Path) -> dict[str, Section]:
    """The sections of one file; ValueError if it is not what somebody meant to write."""
    return _parsed(file.read_bytes(), str(file))


def _parsed(data: bytes, name: str) -> dict[str, Section]:
    from lodeline.pipeline.document import parse
    from lodeline.pipeline.faults import Fault, PipelineError, Place

    if any(word in data.partition(b"\n")[0] for word in HEAD_WORDS):
        head = HEAD.match(data)
        if head is None or int(head[1], 16) != zlib.crc32(data[head.end() :]):
            raise ValueError("crc")
    faults: list[Fault] = []
    try:
        item = parse(data.decode(), lambda line, _: Place(name, line + 1, 1), faults)
    except PipelineError as error:
        faults.extend(error.faults)
        item = None
    except UnicodeDecodeError:
        raise ValueError("is no text") from None
    if faults:
        raise ValueError(f"line {faults[0].line}: {faults[0].text}")
    sections = item.plain() if item is not None else None
    if not isinstance(sections, dict) or not sections:
        raise ValueError("is empty")
    for key, section in sections.items():
        if key not in SECTIONS or not isinstance(section, Mapping):
            raise ValueError(f"{key} is none of the sections {', '.join(SECTIONS)}")
    return sections


def _text(section: tuple[str, Section]) -> str:
    name, values = section
    lines = [f"  {key}: {json.dumps(value)}\n" for key, value in values.items()]
    return f"{name}:\n{''.join(lines)}"


def _replace(file: Path, data: bytes) -> None:
    """Put bytes in the place of a file so that a crash or power cut leaves the old or the new."""
    part = file.with_name(f".{file.name}.tmp")
    try:
        with part.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
