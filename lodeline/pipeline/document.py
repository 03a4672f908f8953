"""YAML with a place for every word, and without the parts of YAML that surprise.

Plain words mean what the core schema of YAML 1.2 (section 10.3.2) says: `1e-3` is a number, `no`
is a text. Refused by name: aliases, merge keys, tags, several documents, keys that stand twice,
and whatever is too large or too deep, before it costs time or memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)
from ruamel.yaml.reader import ReaderError
from ruamel.yaml.scanner import Scanner

from lodeline.pipeline.faults import Fault, PipelineError, Place

MAX_BYTES = 64 * 1024  # some 150 nodes; read in 0.2 s at worst
MAX_ITEMS = 6000
MAX_DEPTH = 32
MAX_TEXT = 1000  # so that a message about it can be read

_INT = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS = {"true": True, "false": False, "null": None}


@dataclass(frozen=True, slots=True)
class Item:
    """A value (scalar, list of items or dict of items), where it stands, where its key stands."""

    value: Any
    place: Place
    key: Place

    def plain(self) -> Any:
        """The value as bare Python objects."""
        if isinstance(self.value, dict):
            return {name: item.plain() for name, item in self.value.items()}
        if isinstance(self.value, list):
            return [item.plain() for item in self.value]
        return self.value


Locate = Callable[[int, int], Place]
"""Place of a line and column that count from 0."""


def is_file(path: Path) -> bool:
    """Whether a path, however odd, leads to a file."""
    try:
        return path.is_file()
    except OSError:  # a name too long, a folder that may not be read
        return False


def read_file(file: Path, faults: list[Fault]) -> Item:
    """The document in a file; PipelineError where nothing can be read at all."""
    whole = Place(str(file))
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise PipelineError([whole.fault(f"cannot be read: {error.strerror}")]) from None
    if len(data) > MAX_BYTES:
        raise PipelineError([whole.fault(f"is larger than {MAX_BYTES // 1024} KiB")])
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        column = len(before[before.rfind(b"\n") + 1 :].decode("utf-8", "replace")) + 1
        text = f"byte 0x{data[error.start]:02x} is not UTF-8"
        raise PipelineError([Fault(str(file), line, column, text)]) from None
    item = parse(text, lambda line, column: Place(str(file), line + 1, column + 1), faults)
    if item is None:
        raise PipelineError([whole.fault("is empty")])
    return item


def parse(text: str, locate: Locate, faults: list[Fault]) -> Item | None:
    """The document in a text, None if there is none; PipelineError where it is no such YAML."""
    try:
        return _Builder(text, locate, faults).document()
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = locate(mark.line, mark.column) if mark else locate(0, 0)
        raise PipelineError([*faults, place.fault(_problem(error))]) from None
    except ReaderError as error:
        before = text[: error.position]
        place = locate(before.count("\n"), error.position - before.rfind("\n") - 1)
        character = f"character U+{ord(text[error.position]):04X}"
        raise PipelineError([*faults, place.fault(f"{character} is not allowed")]) from None


def _problem(error: MarkedYAMLError) -> str:
    text = str(error.problem)
    if isinstance(error, _RefusedError):
        return text
    if r"'\t'" in text:
        return "a tab cannot indent, write spaces"
    context = str(error.context) if error.context else ""
    return f"no YAML: {context}{', ' if context else ''}{text}".splitlines()[0]


class _RefusedError(MarkedYAMLError):
    """Good YAML, but not for a pipeline file."""


class _Scanner(Scanner):
    """Looks ahead for a ':' after a bracket, through all brackets within: stop it in time."""

    def fetch_flow_collection_start(self, TokenClass: Any, to_push: str) -> None:
        if len(self.flow_context) >= MAX_DEPTH:
            text = f"nested deeper than {MAX_DEPTH}"
            raise _RefusedError(problem=text, problem_mark=self.reader.get_mark())
        super().fetch_flow_collection_start(TokenClass, to_push)


class _Builder:
    """Items from the parser's events, so that no number or text is made before it was judged."""

    def __init__(self, text: str, locate: Locate, faults: list[Fault]) -> None:
        yaml = YAML(typ="safe", pure=True)
        yaml.Scanner = _Scanner
        self.events: Iterator[Any] = self._counted(yaml.parse(text))
        self.locate = locate
        self.faults = faults

    def _counted(self, events: Iterator[Any]) -> Iterator[Any]:
        for count, event in enumerate(events):
            if count > MAX_ITEMS:
                self._refuse(event, f"more than {MAX_ITEMS} items")
            if isinstance(event, ScalarEvent) and len(event.value) > MAX_TEXT:
                self._refuse(event, f"a text of more than {MAX_TEXT} characters")
            yield event

    def _refuse(self, event: Any, text: str) -> NoReturn:
        raise _RefusedError(problem=text, problem_mark=event.start_mark)

    def _place(self, event: Any) -> Place:
        return self.locate(event.start_mark.line, event.start_mark.column)

    def document(self) -> Item | None:
        found: Item | None = None
        started = False
        for event in self.events:
            if isinstance(event, DocumentStartEvent):
                if started:
                    self._refuse(event, "a second document starts here, one is read")
                if event.version not in (None, (1, 2)):
                    self._refuse(event, "only YAML 1.2 is read")
                started = True
            elif isinstance(event, ScalarEvent | SequenceStartEvent | MappingStartEvent):
                found = self._item(event, self._place(event), 1)
            elif isinstance(event, AliasEvent):
                self._refuse(event, "aliases (*) are not read, write the value out")
        return found

    def _item(self, event: Any, key: Place, depth: int) -> Item:
        place = self._place(event)
        if isinstance(event, AliasEvent):
            self._refuse(event, "aliases (*) are not read, write the value out")
        if event.anchor is not None:
            self.faults.append(place.fault("anchors (&) are not read, write the value out"))
        if event.tag is not None:
            self.faults.append(place.fault("tags (!) are not read"))
        if depth > MAX_DEPTH:
            self._refuse(event, f"nested deeper than {MAX_DEPTH}")
        if isinstance(event, ScalarEvent):
            if event.style:
                return Item(event.value, place, key)
            # The parser puts what is not there where the next thing is, lines below.
            place = place if event.value else key
            return Item(self._plain(event.value, place), place, key)
        if isinstance(event, SequenceStartEvent):
            return Item(self._list(depth), place, key)
        return Item(self._dict(depth), place, key)

    def _list(self, depth: int) -> list[Item]:
        found: list[Item] = []
        for event in self.events:
            if isinstance(event, SequenceEndEvent):
                break
            found.append(self._item(event, self._place(event), depth + 1))
        return found

    def _dict(self, depth: int) -> dict[str, Item]:
        found: dict[str, Item] = {}
        for event in self.events:
            if isinstance(event, MappingEndEvent):
                break
            key = self._place(event)
            if not isinstance(event, ScalarEvent):
                self._refuse(event, "a key must be a word")
            if event.value == "<<" and not event.style:
                self._refuse(event, "merge keys (<<) are not read, write the values out")
            item = self._item(next(self.events), key, depth + 1)
            if event.value in found:
                first = found[event.value].key
                text = f"{event.value!r} stands twice"
                self.faults.append(
                    key.fault(f"{text}, first in line {first.line}" if first.line else text)
                )
            found.setdefault(event.value, item)
        return found

    def _plain(self, text: str, place: Place) -> Any:
        if text in ("", "~"):
            return None
        if text in (text.lower(), text.upper(), text.capitalize()) and text.lower() in _WORDS:
            return _WORDS[text.lower()]
        if _INT.fullmatch(text):
            number = int(text, 0) if text[1:2] in ("o", "x") else _decimal(text)
            if -(2**63) <= number < 2**63:
                return number
            self.faults.append(place.fault("is a whole number beyond 64 bits"))
            return 0
        if _FLOAT.fullmatch(text):
            return float(text)
        return float(text.replace(".", "")) if _SPECIAL.fullmatch(text) else text


def _decimal(text: str) -> int:
    # Python refuses, and needs quadratic time for, whole numbers of thousands of digits.
    return int(text) if len(text.lstrip("+-0")) < 20 else 2**64
