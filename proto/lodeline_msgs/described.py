"""A message class from its JSON schema: who has a recording may not have the sender's program."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from keyword import iskeyword
from types import new_class
from typing import Annotated, Any

from lodeline_msgs.definition import Message, Unit, unlisted

MOST_FIELDS = 256
_KINDS: dict[str, Any] = {"integer": int, "number": float, "boolean": bool, "string": str}
_NOTE = re.compile(r"(?P<meaning>.*?) ?(?:\[(?P<unit>[^\[\]]*)\])?", re.DOTALL)


def class_described(schema: Any) -> type[Message]:
    """The class that `json_schema` described; it is not among MESSAGES.

    A scalar that may be missing is 0, false or empty where it is: a schema tells no default. Parts
    of arrays have numbers for names. ValueError for a schema of anything else.
    """
    fields = schema.get("properties") if isinstance(schema, Mapping) else None
    if not isinstance(fields, Mapping) or "stamp" not in fields or len(fields) > MOST_FIELDS:
        raise ValueError("no schema of fields with a stamp among them")
    required = schema.get("required")
    needed = required if isinstance(required, list) else []
    body: dict[str, Any] = {"__doc__": str(schema.get("description", "")), "__module__": __name__}
    hints: dict[str, Any] = {}
    for name, said in fields.items():
        _check(name)
        if name in ("stamp", "seq"):
            continue
        hints[name] = _hint(name, said)
        kind = hints[name].__origin__
        if name not in needed and kind in _KINDS.values():
            body[name] = field(default=kind(), kw_only=True)
    body["__annotations__"] = hints
    title = schema.get("title")
    _check(title)
    return unlisted(new_class(str(title), (Message,), {}, lambda names: names.update(body)))


def _check(name: Any) -> None:
    """What becomes code is a word, and nothing else."""
    if not isinstance(name, str) or not name.isidentifier() or iskeyword(name) or name[0] == "_":
        raise ValueError(f"{name!r} is no name of a class or field")


def _hint(name: str, said: Any) -> Any:
    if not isinstance(said, Mapping):
        raise ValueError(f"nothing is said of {name}")
    note = _NOTE.fullmatch(str(said.get("description", "")))
    unit = Unit(note["unit"] or "", note["meaning"]) if note else Unit("")
    return Annotated[_kind(name, said), unit]


def _kind(name: str, said: Mapping[str, Any]) -> Any:
    word = said.get("type")
    if word in _KINDS:
        return _KINDS[word]
    if word == "object":
        part = said.get("additionalProperties")
        of = part.get("type") if isinstance(part, Mapping) else None
        if of in ("number", "integer"):
            return dict[str, float] if of == "number" else dict[str, int]
    if word == "array" and said.get("items") == {"type": "number"}:
        most = said.get("maxItems")
        if most is None:
            return tuple[float, ...]
        if type(most) is int and 0 < most <= MOST_FIELDS and said.get("minItems") == most:
            array: Any = tuple
            return array[(float,) * most]
    raise ValueError(f"{name} is of no kind that a message has")
