"""Any CSV table as samples: a map says, for each field of a key, which column it comes from.

    time: t_ms * ms
    wheels:
      type: WheelTicks
      left: enc_left
      right: -enc_right
    imu/data_raw:
      type: Imu
      angular_velocity: [gx * deg, gy * deg, gz * deg]
      linear_acceleration: [ax * g, ay * g, az * g]

A row in which a cell of a key is empty has no sample of that key. The time may be a sum,
`stamp.sec + stamp.nanosec * ns`, or in ISO 8601.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from lodeline.pipeline.document import Item, read_file
from lodeline.pipeline.faults import Fault, PipelineError
from lodeline.pipeline.shape import Shape
from lodeline.recording.csv_table import Cells, CsvTable
from lodeline.recording.terms import Term, parse
from lodeline_msgs import MESSAGES, FieldSpec, Message, field_specs

LARGEST_COUNT = 1 << 53
LATEST = 9e9  # s


@dataclass(frozen=True, slots=True)
class MappedKey:
    """A key, its class, and the terms of each field that the map gives."""

    key: str
    type: type[Message]
    fields: tuple[tuple[FieldSpec, tuple[Term, ...]], ...]


@dataclass(frozen=True, slots=True)
class TableMap:
    """How rows become samples: the terms that add up to the time [s], and the keys."""

    time: tuple[Term, ...]
    keys: tuple[MappedKey, ...]

    @property
    def columns(self) -> list[str]:
        """The columns in use, each once."""
        terms = [*self.time]
        terms += [term for key in self.keys for _, parts in key.fields for term in parts]
        return list(dict.fromkeys(term.column for term in terms if term.column is not None))


def read_map(file: Path, columns: Collection[str]) -> TableMap:
    """The map in a YAML file; PipelineError with everything that is wrong in it, and where."""
    faults: list[Fault] = []
    root = read_file(file, faults)
    if not isinstance(root.value, dict):
        raise PipelineError([*faults, root.place.fault("must be a map of `time` and keys")])
    items = dict(root.value)
    time = items.pop("time", None)
    if time is None:
        faults.append(root.place.fault("`time` is missing: the column of seconds"))
    terms = () if time is None else _time(time, columns, faults)
    if not items:
        faults.append(root.place.fault("maps no key: `wheels: {type: WheelTicks, left: ...}`"))
    keys = [_key(name, item, columns, faults) for name, item in items.items()]
    if faults:
        raise PipelineError(faults)
    return TableMap(terms, tuple(key for key in keys if key is not None))


def _time(item: Item, columns: Collection[str], faults: list[Fault]) -> tuple[Term, ...]:
    whole = item.value in columns if isinstance(item.value, str) else True
    texts = [item.value] if whole else [part.strip() for part in item.value.split(" + ")]
    parts = [Item(text, item.place, item.key) for text in texts]
    terms = _terms(Item(parts, item.place, item.key), len(parts), columns, faults)
    if any(term.column is None or term.summed for term in terms):
        faults.append(item.place.fault("must be a column, or a sum of columns"))
    return terms


def _key(name: str, item: Item, columns: Collection[str], faults: list[Fault]) -> MappedKey | None:
    from lodeline.params import nearest, shown

    Shape(faults).key(name, item.key)
    if not isinstance(item.value, dict) or "type" not in item.value:
        faults.append(item.place.fault(f"{name} must say its `type` and its fields"))
        return None
    given = dict(item.value)
    kind = given.pop("type")
    word = kind.value if isinstance(kind.value, str) else ""
    cls = MESSAGES.get(word)
    if cls is None:
        text = f"type is no message: {shown(kind.plain())}{nearest(word, MESSAGES)}"
        faults.append(kind.place.fault(text))
        return None
    specs = {spec.name: spec for spec in field_specs(cls) if spec.name not in ("stamp", "seq")}
    fields = []
    for field, value in given.items():
        if field not in specs:
            faults.append(
                value.key.fault(f"{cls.__name__} has no field {field!r}{nearest(field, specs)}")
            )
            continue
        spec = specs.pop(field)
        fields.append((spec, _terms(value, spec.length or 1, columns, faults)))
        if spec.kind not in (int, float, bool) and spec.length is None:
            faults.append(value.place.fault(f"{field} cannot come from a table"))
    for spec in specs.values():
        if spec.required:
            unit = f" [{spec.unit.unit}]" if spec.unit.unit else ""
            faults.append(item.key.fault(f"{name}: field {spec.name!r}{unit} is missing"))
    return MappedKey(name, cls, tuple(fields))


def _terms(
    item: Item, length: int, columns: Collection[str], faults: list[Fault]
) -> tuple[Term, ...]:
    parts = item.value if isinstance(item.value, list) else [item]
    if len(parts) != length:
        faults.append(item.place.fault(f"needs {length} terms, has {len(parts)}"))
        return ()
    found = []
    for part in parts:
        if not isinstance(part.value, str | int | float):
            faults.append(part.place.fault("expected a column or a number"))
            continue
        try:
            found.append(parse(part.value, columns))
        except ValueError as error:
            faults.append(part.place.fault(str(error)))
    return tuple(found)


def samples(table: CsvTable, mapping: TableMap) -> Iterator[tuple[str, Message]]:
    """(key, message) row by row; RecordingError with `file:line:` for what is no such sample."""
    columns = mapping.columns
    places = {column: place for place, column in enumerate(columns)}
    summed = {t.column for k in mapping.keys for _, terms in k.fields for t in terms if t.summed}
    sums = dict.fromkeys(summed, 0.0)
    counts = dict.fromkeys(mapping.keys, 0)
    dated = [t.column for t in mapping.time if t.column and t.factor == 1.0]
    last = None
    for line, cells in table.rows((), columns, dated):
        for column in sums:
            sums[column] += cells[places[str(column)]] or 0.0
        stamp = 0
        for term in mapping.time:
            time = _number(term, cells, places, {})
            if time is None:
                table.fail(line, f"{term.column} is empty, expected a time")
            whole, part = divmod(min(max(time, -LATEST), LATEST), 1.0)
            stamp += int(whole) * 1_000_000_000 + round(part * 1e9)
        if not 0 <= stamp < LATEST * 1e9 or (last is not None and stamp < last):
            what = "goes back" if last is not None and stamp < last else "is no time"
            table.fail(line, f"{mapping.time[0].column} {what}: {stamp * 1e-9:.9g} s")
        last = stamp
        for key in mapping.keys:
            values = _values(key, table, line, cells, places, sums)
            if values is not None:
                yield key.key, key.type(stamp=stamp, seq=counts[key], **values)
                counts[key] += 1


def _values(
    key: MappedKey,
    table: CsvTable,
    line: int,
    cells: Cells,
    places: dict[str, int],
    sums: dict[str | None, float],
) -> dict[str, Any] | None:
    """Fields of one sample by name; None where a cell is empty."""
    found: dict[str, Any] = {}
    for spec, terms in key.fields:
        numbers = [_number(term, cells, places, sums) for term in terms]
        if None in numbers:
            return None
        if not all(isfinite(number) for number in numbers if number is not None):
            table.fail(line, f"{spec.name} is larger than any number, expected something in SI")
        first = numbers[0]
        if spec.length is not None:
            found[spec.name] = tuple(numbers)
        elif spec.kind is int:
            if first is None or first != int(first) or abs(first) > LARGEST_COUNT:
                table.fail(line, f"{spec.name} is {first}, expected a whole number")
            found[spec.name] = int(first)
        else:
            found[spec.name] = spec.kind(first)
    return found


def _number(
    term: Term, cells: Cells, places: dict[str, int], sums: dict[str | None, float]
) -> float | None:
    if term.column is None:
        return term.factor
    cell = cells[places[term.column]]
    if cell is None:
        return None
    return term.factor * (sums[term.column] if term.summed else cell)
