"""Messages to bytes and back: one msgpack map of field name to value per sample.

`pack` and `unpack` run functions that are generated once per class from its field list, as
dataclasses generate `__init__`: 1 us to pack, 2-3 us to unpack with every value checked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any, Literal, NoReturn, TypeVar, cast

import msgpack

from lodeline_msgs.definition import MESSAGES, FieldSpec, Message, field_specs

ENCODING = "application/msgpack"
"""Zenoh encoding of every sample; the class name follows behind a semicolon."""

MAX_BYTES = 65_536
"""Longest payload that is looked at."""
MAX_PARTS = 1_024
"""Longest array or map in a payload."""
MAX_TEXT = 8_192
"""Longest text in a payload, in bytes."""

M = TypeVar("M", bound=Message)


Cause = Literal[
    "too large",
    "truncated",
    "malformed",
    "no map",
    "another class",
    "missing field",
    "wrong type",
    "wrong length",
    "not finite",
]
"""Why a payload is refused, in the words by which receivers count it."""


class DecodeError(ValueError):
    """A payload that is not the message it should be; the text says which field and why."""

    def __init__(self, cause: Cause, text: str) -> None:
        super().__init__(text)
        self.cause = cause


def encoding_of(cls: type[Message]) -> str:
    """Zenoh encoding of a message class, e.g. `application/msgpack;Imu`."""
    return f"{ENCODING};{cls.__name__}"


def class_of(encoding: str) -> type[Message]:
    """Message class behind a Zenoh encoding; DecodeError if we know no such class."""
    name = encoding.partition(";")[2]
    if name not in MESSAGES:
        raise DecodeError(
            "another class", f"encoding {encoding!r} names no message class known here"
        )
    return MESSAGES[name]


def pack(message: Message) -> bytes:
    """Bytes of a message; TypeError or OverflowError if a field holds what msgpack cannot."""
    return packer_of(type(message))(message)


def packer_of(cls: type[Message]) -> Callable[[Any], bytes]:
    """What `pack` does for a class, for who packs many."""
    return _packers.get(cls) or _make_packer(cls)


def unpack(data: bytes, cls: type[M]) -> M:
    """Message of class `cls` from bytes; DecodeError if they are not exactly that.

    Checks size, nesting, types and finiteness. Fields unknown here are skipped, fields that
    have a default may be missing.
    """
    return unpacker_of(cls)(data)


def unpacker_of(cls: type[M]) -> Callable[[bytes], M]:
    """What `unpack` does for a class, for who unpacks many."""
    unpacker = _unpackers.get(cls) or _make_unpacker(cls)
    return cast(Callable[[bytes], M], unpacker)


def unpack_map(data: bytes) -> dict[str, Any]:
    """The map in a payload, its values unchecked; DecodeError if there is none."""
    if len(data) > MAX_BYTES:
        raise DecodeError("too large", f"payload of {len(data)} bytes, more than {MAX_BYTES}")
    try:
        values = msgpack.unpackb(
            data,
            use_list=False,
            max_array_len=MAX_PARTS,
            max_map_len=MAX_PARTS,
            max_str_len=MAX_TEXT,
            max_bin_len=0,
            max_ext_len=0,
        )
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError) as error:
        text = str(error) or type(error).__name__
        raise DecodeError(_cause_of(text), f"not msgpack: {text}") from None
    if type(values) is not dict:
        kind = type(values).__name__
        raise DecodeError("no map", f"a {kind} where a map of field names is expected")
    return values


def _cause_of(text: str) -> Cause:
    """What msgpack found; it has one exception class for most of it, but words of its own."""
    if "incomplete input" in text:
        return "truncated"
    return "too large" if "exceeds max_" in text else "malformed"


# One packer serves all: packing built-in types never runs other Python code in between.
_packb: Callable[[Any], bytes] = msgpack.Packer(
    use_bin_type=True, autoreset=True, buf_size=MAX_BYTES
).pack
_packers: dict[type[Message], Callable[[Any], bytes]] = {}
_unpackers: dict[type[Message], Callable[[bytes], Message]] = {}


def _make_packer(cls: type[Message]) -> Callable[[Any], bytes]:
    pairs = ", ".join(f"{spec.name!r}: m.{spec.name}" for spec in field_specs(cls))
    packer: Callable[[Any], bytes] = _define(
        f"def made(m):\n return packb({{{pairs}}})", {"packb": _packb}
    )
    _packers[cls] = packer
    return packer


def _make_unpacker(cls: type[Message]) -> Callable[[bytes], Message]:
    specs = field_specs(cls)
    every = ", ".join(f"f_{spec.name}" for spec in specs)
    lines = ["def made(data):", " values = unpack_map(data)", " try:"]
    for spec in specs:
        found = f"[{spec.name!r}]" if spec.required else f".get({spec.name!r}, d_{spec.name})"
        lines.append(f"  f_{spec.name} = values{found}")
    lines += [
        " except KeyError as error:",
        "  missing(error)",
        f" if not ({_quick_check(specs)}):",
        f"  {every}, = mend(({every},))",
        f" return cls({_arguments(specs, cls)})",
    ]
    names: dict[str, Any] = {
        "cls": cls,
        "isfinite": isfinite,
        "unpack_map": unpack_map,
        "mend": lambda values: _mend_all(values, specs, cls),
        "missing": lambda error: _missing(error, cls),
    }
    for spec in specs:
        if not spec.required:
            names[f"d_{spec.name}"] = cls.__dataclass_fields__[spec.name].default
    unpacker: Callable[[bytes], Message] = _define("\n".join(lines), names)
    _unpackers[cls] = unpacker
    return unpacker


def _arguments(specs: Sequence[FieldSpec], cls: type[Message]) -> str:
    """By place where that is possible: the shortest way into a message."""
    by_name = {spec.name for spec in specs if cls.__dataclass_fields__[spec.name].kw_only}
    places = [f"f_{spec.name}" for spec in specs if spec.name not in by_name]
    return ", ".join([*places, *(f"{name}=f_{name}" for name in sorted(by_name))])


def _missing(error: KeyError, cls: type[Message]) -> NoReturn:
    text = f"{cls.__name__}: field {error.args[0]!r} is missing"
    raise DecodeError("missing field", text) from None


def _define(source: str, names: dict[str, Any]) -> Any:
    exec(source, names)  # noqa: S102 - our own field names, as dataclasses does
    return names["made"]


def _quick_check(specs: Sequence[FieldSpec]) -> str:
    """Expression that is true for values that need no second look.

    A sum is finite only if all its parts are; one that overflows is looked at again.
    """
    checks, numbers = [], []
    for spec in specs:
        name, kind = f"f_{spec.name}", spec.kind
        if kind in (int, bool, str, float):
            checks.append(f"type({name}) is {kind.__name__}")
            numbers += [name] if kind is float else []
        elif spec.length is not None:
            parts = [f"{name}[{i}]" for i in range(spec.length)]
            types = " is ".join(f"type({part})" for part in parts)
            checks.append(f"type({name}) is tuple and len({name}) == {spec.length}")
            checks.append(f"{types} is float")
            numbers += parts
        else:
            checks.append(f"{name} == ()")  # maps and arrays of open length, unless empty
    if numbers:
        checks.append(f"isfinite({' + '.join(numbers)})")
    return " and ".join(checks)


def _mend_all(
    values: Sequence[Any], specs: Sequence[FieldSpec], cls: type[Message]
) -> tuple[Any, ...]:
    return tuple(_mend(value, spec, cls) for value, spec in zip(values, specs, strict=True))


def _mend(value: Any, spec: FieldSpec, cls: type[Message]) -> Any:
    """The value in its exact type (an integer where a float belongs), or DecodeError."""
    where = f"{cls.__name__}.{spec.name}"
    kind = spec.kind
    if kind in (int, bool, str):
        if type(value) is kind:
            return value
        raise _wrong_type(where, value, kind.__name__)
    if kind is float:
        return _number(value, where)
    if kind == dict[str, float] or kind == dict[str, int]:
        if type(value) is not dict or any(type(key) is not str for key in value):
            raise DecodeError("wrong type", f"{where}: a map from text is expected")
        if kind == dict[str, float]:
            return {key: _number(part, f"{where}[{key!r}]") for key, part in value.items()}
        for key, part in value.items():
            if type(part) is not int:
                raise _wrong_type(f"{where}[{key!r}]", part, "int")
        return value
    if type(value) is not tuple:
        raise _wrong_type(where, value, "an array")
    if spec.length is not None and len(value) != spec.length:
        text = f"{where}: {len(value)} parts where {spec.length} are expected"
        raise DecodeError("wrong length", text)
    return tuple(_number(part, f"{where}[{i}]") for i, part in enumerate(value))


def _number(value: Any, where: str) -> float:
    if type(value) is int:
        if abs(value) > 1 << 53:
            raise DecodeError("wrong type", f"{where}: the integer {value} is no exact float")
        return float(value)
    if type(value) is not float:
        raise _wrong_type(where, value, "a number")
    if not isfinite(value):
        raise DecodeError("not finite", f"{where}: {value} is not a finite number")
    return value


def _wrong_type(where: str, value: Any, wanted: str) -> DecodeError:
    text = f"{where}: {type(value).__name__} where {wanted} is expected"
    return DecodeError("wrong type", text)
