"""What each shipped node takes, docs/nodes.md: `python -m lodeline.terminal.node_manual`.

Written from the nodes' own classes: ports, parameters, units, defaults.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from lodeline.loading import load_node, shipped
from lodeline.node import Driver, Node
from lodeline.params import Kind, kind_of

HEAD = """\
# The nodes that come with Lodeline

Generated from the nodes' own classes by `python -m lodeline.terminal.node_manual`; do not edit.

A parameter `imu.rate` stands in the pipeline file as `params: {imu: {rate: ...}}`, and on the
command line as `--set NODE.imu.rate=...`. Units are SI, angles in radians."""


def node_manual() -> str:
    """The whole text."""
    programs = sorted(shipped("nodes").glob("*.py"))
    sections = ["\n\n".join(_section(f"nodes/{file.name}", load_node(file))) for file in programs]
    return "\n\n".join([HEAD, *sections]) + "\n"


def _section(path: str, node: type[Node[Any]]) -> Iterator[str]:
    yield f"## {path}"
    caption = (sys.modules[node.__module__].__doc__ or "").strip().splitlines()[0]
    yield caption + (
        " A driver: it ticks `rate` times a second." if issubclass(node, Driver) else ""
    )
    ports = [
        f"| in | `{name}` | {port.message.__name__} | newest {port.queue}"
        f"{'' if port.max_age is None else f', {port.max_age:g} s at most'} |"
        for name, port in node.inputs().items()
    ]
    ports += [f"| out | `{name}` | {p.message.__name__} | |" for name, p in node.outputs().items()]
    yield "\n".join(["| | port | message | queue |", "|---|---|---|---|", *ports])
    rows: list[str] = []
    notes: list[str] = []
    _describe(node.params_type(), "", rows, notes)
    if rows:
        yield "\n".join(["| parameter | is | unit | default |", "|---|---|---|---|", *rows])
    yield from notes


def _describe(cls: Any, prefix: str, rows: list[str], notes: list[str]) -> None:
    """Rows of a class of parameters and of those below it; what their docstrings say."""
    text = " ".join((cls.__doc__ or "").split())
    if text and not text.startswith(f"{cls.__name__}("):
        notes.append(f"`{prefix[:-1]}`: {text}" if prefix else text)
    hints = get_type_hints(cls, include_extras=True)
    for item in fields(cls):
        kind = kind_of(hints[item.name])
        below = [each for each in kind.types if is_dataclass(each)]
        for each in below:
            _describe(each, f"{prefix}{item.name}.", rows, notes)
        if not below:
            rows.append(
                f"| `{prefix}{item.name}` | {_words(kind)} | {_unit(kind)} | {_default(item)} |"
            )


def _words(kind: Kind) -> str:
    return " or ".join(_type(each) for each in kind.types if each is not NoneType)


def _type(each: Any) -> str:
    args = get_args(each)
    if get_origin(each) is Literal:
        return ", ".join(f"`{option}`" for option in args)
    if get_origin(each) is tuple:
        return "list" if args[-1:] == (Ellipsis,) else f"list of {len(args)}"
    return {bool: "true or false", int: "whole number", float: "number"}.get(each, "text")


def _unit(kind: Kind) -> str:
    return "" if kind.unit == "1" else kind.unit


def _default(item: Field[Any]) -> str:
    value = item.default
    if item.default_factory is not MISSING:
        value = item.default_factory()
    if value is MISSING:
        return "must be given"
    if isinstance(value, tuple):
        return f"`[{', '.join(map(str, value))}]`"
    if value is None or value == "":
        return "none"
    if item.name.endswith("address"):
        return f"`0x{value:02x}`"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


if __name__ == "__main__":
    print(node_manual(), end="")
