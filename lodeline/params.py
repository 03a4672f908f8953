"""Values from a file or a command line, checked against a dataclass of parameters."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from math import isfinite
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

T = TypeVar("T")

_SCALARS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong; `path` leads to it from the top of the parameters."""

    path: tuple[str | int, ...]
    text: str


def build(cls: type[T], values: Mapping[str, Any]) -> tuple[T | None, list[Problem]]:
    """An instance of the dataclass `cls` from plain values, or None and all that is wrong."""
    hints = get_type_hints(cls, include_extras=True)
    known = {item.name: item for item in fields(cls)}  # type: ignore[arg-type]
    problems: list[Problem] = []
    given: dict[str, Any] = {}
    for name, value in values.items():
        if name not in known:
            problems.append(Problem((name,), f"unknown parameter {name!r}{nearest(name, known)}"))
            continue
        given[name] = convert(value, hints[name], name, (name,), problems)
    for name, item in known.items():
        if name not in values and item.default is MISSING and item.default_factory is MISSING:
            problems.append(Problem((), f"parameter {name!r} is missing"))
    if problems:
        return None, problems
    try:
        return cls(**given), []
    except ValueError as error:
        return None, [Problem((), str(error))]


def convert(
    value: Any, hint: Any, name: str, path: tuple[str | int, ...], problems: list[Problem]
) -> Any:
    """`value` in the type that `hint` names (lists become tuples); else adds to `problems`."""
    unit = ""
    if get_origin(hint) is Annotated:
        hint, note = get_args(hint)[:2]
        unit = f" [{note}]" if isinstance(note, str) and note not in ("", "1") else ""

    def wrong(expected: str) -> None:
        problems.append(Problem(path, f"{name} must be {expected}{unit}, got {_shown(value)}"))

    origin = get_origin(hint)
    if origin in (Union, UnionType):
        options = get_args(hint)
        if value is None and type(None) in options:
            return None
        return _union(value, [option for option in options if option is not type(None)], wrong)
    if is_dataclass(hint):
        return _nested(value, hint, path, problems, wrong)
    if origin is Literal:
        if value not in get_args(hint):
            words = ", ".join(str(option) for option in get_args(hint))
            wrong(f"one of {words}")
        return value
    if origin is tuple:
        return _tuple(value, hint, name, path, problems, wrong)
    if hint is float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            wrong(_SCALARS[float])
            return value
        return float(value)
    if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
        wrong(_SCALARS[hint])
    return value


def _union(value: Any, options: list[Any], wrong: Callable[[str], None]) -> Any:
    """The value as the first option that takes it."""
    for option in options:
        misfits: list[Problem] = []
        converted = convert(value, option, "", (), misfits)
        if not misfits:
            return converted
    words = (_SCALARS.get(option) or " or ".join(map(str, get_args(option))) for option in options)
    wrong(" or ".join(words))
    return value


def _nested(
    value: Any,
    cls: Any,
    path: tuple[str | int, ...],
    problems: list[Problem],
    wrong: Callable[[str], None],
) -> Any:
    """A group of parameters within the parameters."""
    if isinstance(value, cls):
        return value
    if not isinstance(value, Mapping):
        wrong("a mapping of parameters")
        return value
    made, found = build(cls, value)
    problems += [Problem((*path, *problem.path), problem.text) for problem in found]
    return made


def _tuple(
    value: Any,
    hint: Any,
    name: str,
    path: tuple[str | int, ...],
    problems: list[Problem],
    wrong: Any,
) -> Any:
    parts = get_args(hint)
    if not isinstance(value, list | tuple):
        wrong("a list")
        return value
    if parts[-1] is Ellipsis:
        parts = (parts[0],) * len(value)
    if len(value) != len(parts):
        wrong(f"a list of {len(parts)}")
        return value
    return tuple(
        convert(part, kind, f"{name}[{i}]", (*path, i), problems)
        for i, (part, kind) in enumerate(zip(value, parts, strict=True))
    )


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return f'the text "{value}"'
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    return {True: "true", False: "false", None: "nothing"}.get(value, str(value))


def nearest(name: str, known: Iterable[str]) -> str:
    """`, did you mean ...?` with the nearest of the known names, or the list of them if short."""
    names = [str(item) for item in known]
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if close:
        return f", did you mean {close[0]!r}?"
    return f" (known: {', '.join(names)})" if 0 < len(names) <= 16 else ""
