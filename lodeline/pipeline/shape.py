"""Items of a document in the shape that is expected, or a fault that says what is not."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from lodeline.params import Problem, closest, convert, nearest, shown
from lodeline.pipeline.document import Item
from lodeline.pipeline.faults import Fault, Place

NAME = re.compile(r"[a-z][a-z0-9_-]*")
NODE_NAME = re.compile(r"[a-z][a-z0-9_]*")  # it is part of a key: status/NAME
_KEY = re.compile(r"[a-z0-9_]+(/[a-z0-9_]+)*")


@dataclass(slots=True)
class Shape:
    """Reads values and notes what is wrong; returns something harmless in place of what is."""

    faults: list[Fault]

    def fault(self, place: Place, text: str) -> None:
        self.faults.append(place.fault(text))

    def mapping(
        self, item: Item | None, what: str, known: Iterable[str] | None = None
    ) -> dict[str, Item]:
        """The members of a mapping, {} if there is none; only `known` keys if these are given."""
        if item is None or item.value is None:
            return {}
        if not isinstance(item.value, dict):
            self.fault(item.place, f"{what} must be a mapping, got {shown(item.plain())}")
            return {}
        if known is None:
            return item.value
        names = list(known)
        found: dict[str, Item] = {}
        for name, member in item.value.items():
            if name not in names:
                self.fault(member.key, f"unknown key {name!r} in {what}{nearest(name, names)}")
                # Read as what it was meant to be, so that one slip is one fault.
                name = closest(name, [free for free in names if free not in item.value]) or name
            found.setdefault(name, member)
        return found

    def value(self, item: Item | None, hint: Any, what: str, default: Any = None) -> Any:
        """A value of the type in `hint`; the default if there is none or a wrong one."""
        if item is None:
            return default
        problems: list[Problem] = []
        value = convert(item.plain(), hint, what, (), problems)
        for problem in problems:
            self.fault(item.place, problem.text)
        return default if problems else value

    def ranged(self, item: Item | None, what: str, low: int, high: int) -> int | None:
        """A whole number from `low` to `high` inclusive."""
        value: int | None = self.value(item, int, what)
        if item is not None and value is not None and not low <= value <= high:
            self.fault(item.place, f"{what} must be from {low} to {high}, got {value}")
            return None
        return value

    def positive(self, item: Item | None, hint: Any, what: str) -> float | None:
        """A number above zero."""
        value: float | None = self.value(item, hint, what)
        if item is not None and value is not None and value <= 0:
            self.fault(item.place, f"{what} must be positive, got {value:g}")
            return None
        return value

    def name(self, name: str, place: Place, what: str, pattern: re.Pattern[str] = NAME) -> None:
        if not pattern.fullmatch(name):
            dash = ", -" if pattern is NAME else ""
            text = f"{what} {name!r} must start with a-z and hold only a-z, 0-9, _{dash}"
            self.fault(place, text)

    def key(self, key: str, place: Place) -> None:
        if not _KEY.fullmatch(key):
            text = "may hold a-z, 0-9 and _, in parts separated by /"
            self.fault(place, f"key {key!r} {text}")
        elif key.split("/")[0] == "status":
            self.fault(place, f"key {key!r} is reserved: nodes send their health there")
