"""Values from a file or a command line, checked against a dataclass of parameters.

A field may be a bool, int, float, str, a Literal, a tuple of these, a dataclass of its own, or
one of several of them (`int | str`, `float | None`), and carries its unit as `Annotated` text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from math import isfinite
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

T = TypeVar("T")
Path = tuple[str | int, ...]

_SCALARS: dict[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
}


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong; `path` leads to it from the top of the parameters.

    `at_key`: the name is what is wrong, not the value that it has.
    """

    path: Path
    text: str
    at_key: bool = False


@dataclass(frozen=True, slots=True)
class Kind:
    """A type hint taken apart: the bare types that a value may have, and its unit ("" if none)."""

    types: tuple[Any, ...]
    unit: str

    @property
    def words(self) -> str:
        """What a value must be."""
        text = " or ".join(_type_words(each) for each in self.types if each is not NoneType)
        return f"{text} [{self.unit}]" if self.unit not in ("", "1") else text


def _type_words(each: Any) -> str:
    args = get_args(each)
    if get_origin(each) is Literal:
        listed = ", ".join(str(option) for option in args)
        return f"one of {listed}" if len(args) > 1 else listed
    if get_origin(each) is tuple:
        return "a list" if args[-1:] == (Ellipsis,) else f"a list of {len(args)}"
    return _SCALARS.get(each, "a mapping of parameters")


def kind_of(hint: Any) -> Kind:
    """A hint without its `Annotated` and its `|`; TypeError if no file can hold such a value."""
    unit = ""
    while get_origin(hint) is Annotated:
        hint, note = get_args(hint)[:2]
        unit = note if isinstance(note, str) else unit
    if get_origin(hint) in (Union, UnionType):
        parts = [kind_of(option) for option in get_args(hint)]
        types = tuple(each for part in parts for each in part.types)
        return Kind(types, unit or next((part.unit for part in parts if part.unit), ""))
    composed = get_origin(hint) in (Literal, tuple) or is_dataclass(hint)
    if not composed and hint is not NoneType and hint not in _SCALARS:
        raise TypeError(f"is of type {getattr(hint, '__name__', hint)}, which no file can hold")
    return Kind((hint,), unit)


def check_class(cls: Any) -> None:
    """TypeError, with the reason, if a class of parameters cannot be filled from a file."""
    if not is_dataclass(cls):
        raise TypeError(f"params class {getattr(cls, '__name__', cls)} is no dataclass")
    hints = get_type_hints(cls, include_extras=True)
    for item in fields(cls):
        try:
            _check_hint(hints[item.name])
        except TypeError as error:
            name = getattr(cls, "__name__", cls)
            raise TypeError(f"field {item.name!r} of {name} {error}") from None


def _check_hint(hint: Any) -> None:
    for each in kind_of(hint).types:
        if is_dataclass(each):
            check_class(each)
        elif get_origin(each) is tuple:
            for part in get_args(each):
                if part is not Ellipsis:
                    _check_hint(part)


def build(cls: type[T], values: Mapping[str, Any]) -> tuple[T | None, list[Problem]]:
    """An instance of the dataclass `cls` from plain values, or None and all that is wrong."""
    hints = get_type_hints(cls, include_extras=True)
    known = {item.name: item for item in fields(cls)}  # type: ignore[arg-type]
    problems: list[Problem] = []
    given: dict[str, Any] = {}
    for name, value in values.items():
        if name not in known:
            text = f"unknown parameter {name!r}{nearest(name, known)}"
            problems.append(Problem((name,), text, at_key=True))
            continue
        given[name] = convert(value, hints[name], name, (name,), problems)
    missing = [
        Problem((), f"parameter {name!r} is missing")
        for name, item in known.items()
        if name not in values and item.default is MISSING and item.default_factory is MISSING
    ]
    if missing:
        return None, problems + missing
    wrong = {problem.path[0] for problem in problems}
    try:
        made = cls(**{name: value for name, value in given.items() if name not in wrong})
    except (ValueError, TypeError, ArithmeticError) as error:
        named = [word for word in re.findall(r"\w+", str(error)) if word in known]
        # Beside other problems only what concerns one good value is sure to be a fault.
        if not problems or (len(set(named)) == 1 and named[0] in given.keys() - wrong):
            blamed = tuple(name for name in named if name in given)[:1]
            problems.append(Problem(blamed, str(error)))
        return None, problems
    return (None if problems else made), problems


def convert(value: Any, hint: Any, name: str, path: Path, problems: list[Problem]) -> Any:
    """`value` as the first type of `hint` that takes it; else adds to `problems`.

    Lists become tuples, mappings the dataclass that the hint names, whole numbers floats.
    """
    kind = kind_of(hint)
    for each in kind.types:
        if _fits(value, each):
            return _made(value, each, kind.unit, name, path, problems)
    text = f"{name} must be {kind.words}, got {shown(value)}{_advice(value, kind)}"
    problems.append(Problem(path, text))
    return value


def _fits(value: Any, each: Any) -> bool:
    """Whether a value has the shape of a type; what is in a list or group is judged later."""
    if get_origin(each) is Literal:
        # A whole number is no truth value, though Python holds 1 and True to be equal.
        return any(type(value) is type(option) and value == option for option in get_args(each))
    if get_origin(each) is tuple:
        parts = get_args(each)
        open_length = parts[-1:] == (Ellipsis,)
        return isinstance(value, list | tuple) and (open_length or len(value) == len(parts))
    if is_dataclass(each):
        return isinstance(value, Mapping) or type(value) is each
    if each is float:
        return type(value) in (int, float) and isfinite(value)
    return type(value) is each


def _made(value: Any, each: Any, unit: str, name: str, path: Path, problems: list[Problem]) -> Any:
    if get_origin(each) is tuple:
        return _list(value, get_args(each), unit, name, path, problems)
    if is_dataclass(each) and isinstance(value, Mapping):
        made, found = build(each, value)  # type: ignore[arg-type]
        problems += [Problem((*path, *one.path), one.text, one.at_key) for one in found]
        return made
    return float(value) if each is float else value


def _list(
    value: Any, parts: tuple[Any, ...], unit: str, name: str, path: Path, problems: list[Problem]
) -> tuple[Any, ...]:
    hints = parts[:1] * len(value) if parts[-1:] == (Ellipsis,) else parts
    # The unit of a list is that of each part, or names one for each: "m, m, rad".
    units = unit.split(", ")
    units = units if len(units) == len(hints) else [unit] * len(hints)
    return tuple(
        convert(part, Annotated[hint, own], f"{name}[{i}]", (*path, i), problems)
        for i, (part, hint, own) in enumerate(zip(value, hints, units, strict=True))
    )


def _advice(value: Any, kind: Kind) -> str:
    """What a text in the wrong place was perhaps meant to be."""
    if not isinstance(value, str):
        return ""
    words = [word for each in kind.types if get_origin(each) is Literal for word in get_args(each)]
    if words:
        return guess(value, words)
    quoted = {int, float} & set(kind.types) and re.fullmatch(r"[-+.\d]+(e[-+]?\d+)?", value, re.I)
    return ", write it without quotes" if quoted else ""


def shown(value: Any) -> str:
    """A value as a message names it."""
    if isinstance(value, str):
        return f'the text "{value}"'
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    if value is None:
        return "nothing"
    return str(value).lower() if isinstance(value, bool) else str(value)


def closest(name: str, known: Iterable[str]) -> str | None:
    """The one of the known names that is most like `name`, None if none is much like it."""
    import difflib  # only who errs pays for it

    close = difflib.get_close_matches(name, [str(item) for item in known], n=1, cutoff=0.6)
    return close[0] if close else None


def guess(name: str, known: Iterable[str]) -> str:
    """`, did you mean ...?` with the closest of the known names, "" if there is none."""
    found = closest(name, known)
    return f", did you mean {found!r}?" if found else ""


def nearest(name: str, known: Iterable[str]) -> str:
    """`, did you mean ...?` with the nearest of the known names, or the list of them if short."""
    names = [str(item) for item in known]
    listed = f" (known: {', '.join(names)})" if 0 < len(names) <= 16 else ""
    return guess(name, names) or listed
