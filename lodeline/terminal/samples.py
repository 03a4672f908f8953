"""Samples as text for people, and text from people as samples."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import msgpack

from lodeline.params import nearest
from lodeline_msgs import (
    FieldSpec,
    Message,
    field_specs,
    stamp_text,
    unpack,
    unpack_map,
)


def sample_text(data: bytes, specs: Sequence[FieldSpec], as_json: bool) -> str:
    """A packed sample as one line of JSON, or as lines of `field: value unit`, units by `specs`.

    DecodeError if the bytes are no map of fields.
    """
    values = unpack_map(data)
    if as_json:
        return json.dumps(values)
    # Numbers without a unit have none to show, and of a stamp both are told: ns and seconds.
    units = {spec.name: spec.unit.unit for spec in specs if spec.unit.unit not in ("", "1", "ns")}
    lines = [
        f"{name}: {value_text(name, value)} {units.get(name, '')}" for name, value in values.items()
    ]
    return "\n".join([*(line.rstrip() for line in lines), "---"])


def value_text(name: str, value: Any) -> str:
    """A value of a field: floats short, stamps in seconds too."""
    if name == "stamp" and isinstance(value, int):
        return f"{value} ns ({stamp_text(value)} s)"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return f"[{', '.join(value_text('', part) for part in value)}]"
    if isinstance(value, Mapping):
        parts = ", ".join(f"{key}: {value_text('', part)}" for key, part in value.items())
        return f"{{{parts}}}"
    return str(value)


def read_values(words: Sequence[str]) -> dict[str, Any]:
    """Fields from words: each is a YAML map in braces, or `field=value`. ValueError if not."""
    from lodeline.pipeline.document import parse  # YAML is slow to load
    from lodeline.pipeline.faults import Fault, PipelineError, Place

    values: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        is_map = word.lstrip().startswith("{")
        if not is_map and not (equals and name.strip()):
            raise ValueError(f"{word!r} is neither a map in braces nor field=value")
        faults: list[Fault] = []
        try:
            item = parse(word if is_map else text, lambda _line, _column: Place(""), faults)
        except PipelineError as error:
            faults = error.faults
        if faults:
            raise ValueError(f"{word!r}: {faults[0].text}")
        found = None if item is None else item.plain()
        if is_map and isinstance(found, dict):
            values |= found
        else:
            values[name.strip()] = found
    return values


def make_message(cls: type[Message], values: Mapping[str, Any], stamp: int, seq: int) -> Message:
    """A message of class `cls`, checked as if it had come over the wire; ValueError if it is none.

    A stamp or number among the values goes before the given ones.
    """
    names = [spec.name for spec in field_specs(cls)]
    for name in values:
        if name not in names:
            raise ValueError(f"{cls.__name__} has no field {name!r}{nearest(name, names)}")
    try:
        data = msgpack.packb({"stamp": stamp, "seq": seq, **values})
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(str(error)) from None
    return unpack(data, cls)  # its DecodeError is a ValueError
