"""What other programs want to know of a message: its JSON schema, its columns, its unit table."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from lodeline_msgs.definition import MESSAGES, FieldSpec, Message, field_specs

_SCALARS: dict[Any, str] = {int: "integer", float: "number", bool: "boolean", str: "string"}
_PAIR = re.compile(r"(.+?)=(\S+)(?: |$)")  # in a cell of several; `too old=3`: keys may hold spaces


def json_schema(cls: type[Message]) -> dict[str, Any]:
    """JSON schema of the map on the wire (MCAP files carry it, PlotJuggler asks for it)."""
    specs = field_specs(cls)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": cls.__name__,
        "description": (cls.__doc__ or "").strip().splitlines()[0],
        "type": "object",
        "properties": {spec.name: _field_schema(spec) for spec in specs},
        "required": [spec.name for spec in specs if spec.required],
    }


def _field_schema(spec: FieldSpec) -> dict[str, Any]:
    note = f"{spec.unit.meaning} [{spec.unit.unit}]" if spec.unit.unit else spec.unit.meaning
    schema: dict[str, Any] = {"description": note}
    if spec.kind in _SCALARS:
        return {"type": _SCALARS[spec.kind], **schema}
    if spec.kind == dict[str, float] or spec.kind == dict[str, int]:
        part = "number" if spec.kind == dict[str, float] else "integer"
        return {"type": "object", "additionalProperties": {"type": part}, **schema}
    schema = {"type": "array", "items": {"type": "number"}, **schema}
    if spec.length is not None:
        schema |= {"minItems": spec.length, "maxItems": spec.length}
    return schema


def columns(cls: type[Message]) -> list[str]:
    """Column names of a table of such messages: stamp, the fields (arrays by part), seq last."""
    names = ["stamp"]
    for spec in field_specs(cls):
        if spec.name in ("stamp", "seq"):
            continue
        if spec.length is None:
            names.append(spec.name)
        else:
            parts = spec.unit.parts or range(spec.length)
            names += [f"{spec.name}_{part}" for part in parts]
    return [*names, "seq"]


def row(message: Message) -> list[str]:
    """Cells of a message in the order of `columns`; stamp in seconds, floats to the last bit."""
    cells = [stamp_text(message.stamp)]
    for spec in field_specs(type(message)):
        if spec.name in ("stamp", "seq"):
            continue
        value = getattr(message, spec.name)
        if spec.length is not None:
            cells += [repr(part) for part in value]
        elif isinstance(value, bool):
            cells.append(str(int(value)))
        elif isinstance(value, tuple):
            cells.append(" ".join(repr(part) for part in value))
        elif isinstance(value, dict):
            cells.append(" ".join(f"{key}={part}" for key, part in value.items()))
        else:
            cells.append(repr(value) if isinstance(value, float) else str(value))
    return [*cells, str(message.seq)]


def from_row(cls: type[Message], cells: Sequence[str]) -> Message:
    """The message that `row` wrote; ValueError for cells that it never writes."""
    specs = {spec.name: spec for spec in field_specs(cls)}
    left = list(cells)
    if len(left) != len(columns(cls)):
        raise ValueError(f"{len(left)} cells where {len(columns(cls))} are expected")
    seconds, _, rest = left.pop(0).partition(".")
    if len(rest) != 9:
        raise ValueError("a stamp without nine decimals")
    values: dict[str, Any] = {"stamp": int(seconds + rest), "seq": int(left.pop())}
    for name, spec in specs.items():
        if name in values:
            continue
        if spec.length is not None:
            values[name] = tuple(float(left.pop(0)) for _ in range(spec.length))
        else:
            values[name] = _cell(spec, left.pop(0))
    return cls(**values)


def _cell(spec: FieldSpec, text: str) -> Any:
    if spec.kind is bool:
        return bool(int(text))
    if spec.kind in _SCALARS:
        return spec.kind(text)
    if spec.kind in (dict[str, float], dict[str, int]):
        number = float if spec.kind == dict[str, float] else int
        return {key: number(part) for key, part in _PAIR.findall(text)}
    return tuple(map(float, text.split()))


def stamp_text(stamp: int) -> str:
    """A stamp in ns as seconds with all nine decimals."""
    sign, stamp = ("-", -stamp) if stamp < 0 else ("", stamp)
    return f"{sign}{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d}"


def unit_table() -> Iterator[str]:
    """Markdown lines of the table of all messages in proto/README.md."""
    yield "| message | field | type | unit | meaning |"
    yield "|---|---|---|---|---|"
    for name, cls in MESSAGES.items():
        for spec in field_specs(cls):
            yield (
                f"| {name} | `{spec.name}` | {_type_text(spec)} "
                f"| {spec.unit.unit or '-'} | {spec.unit.meaning} |"
            )


def _type_text(spec: FieldSpec) -> str:
    if spec.kind in _SCALARS:
        return spec.kind.__name__  # type: ignore[no-any-return]
    if spec.kind == dict[str, float] or spec.kind == dict[str, int]:
        return "map of text to number"
    return f"array of {spec.length} floats" if spec.length else "array of floats"
