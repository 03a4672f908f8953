"""A node's state on file, so that its successor after a crash goes on where it stood.

The file lies in the run folder, is replaced as a whole, and outlives the process, not a power cut.
"""

from __future__ import annotations

import contextlib
import sys
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import msgpack

from lodeline.node import Node


class Keepsake:
    """The state file of one node: `look` and `store` now and then, `restore` once at the start.

    With the state go marks: the stamp [ns] of the newest sample in it, by key.
    """

    def __init__(self, node: Node[Any], folder: Path) -> None:
        self._node = node
        self._file = folder / f"{node.context.name}.msgpack"
        self._part = self._file.with_suffix(".part")
        self._stored = b""
        self._unkept = False

    def look(self, marks: Mapping[str, int]) -> bytes:
        """The node's state as it is now, while no handler runs; empty if there is none."""
        state = self._node.save()
        return b"" if state is None else msgpack.packb([state, dict(marks)], default=_parts)

    def store(self, data: bytes) -> None:
        """Write what `look` saw if it is something new; a slow disk may take its time.

        A full one is told once, and costs the node no more than its last state.
        """
        if not data or data == self._stored:
            return
        try:
            self._part.write_bytes(zlib.crc32(data).to_bytes(4, "little") + data)
            self._part.replace(self._file)
        except OSError as error:
            if not self._unkept:
                name = self._node.context.name
                print(f"STATE_NOT_KEPT {name}: {error}", file=sys.stderr, flush=True)
            self._unkept = True
        else:
            self._stored, self._unkept = data, False

    def restore(self) -> dict[str, int] | None:
        """Hand the state on file to the node; its marks, or None if there was none to take."""
        kind = type(self._node).State
        if kind is None or not self._file.exists():
            return None
        try:
            values, marks = _checked(self._file.read_bytes())
            state = rebuilt(values, kind)
        except Exception as error:
            self._tell_lost(error)
            return None
        try:
            self._node.resume(state)
        except Exception as error:  # `resume` is the user's: raised here, no start would succeed
            with contextlib.suppress(Exception):  # which half of a state may trip up as well
                self._node.close()
            self._node.setup()
            self._tell_lost(error)
            return None
        return dict(marks)

    def _tell_lost(self, error: Exception) -> None:
        text = f"STATE_LOST {self._node.context.name}: {error}; starting afresh"
        print(text, file=sys.stderr, flush=True)

    def forget(self) -> None:
        """The successor is to start afresh: this state may be what is wrong."""
        self._file.unlink(missing_ok=True)


def rebuilt(value: Any, hint: Any) -> Any:
    """A value that was taken apart to maps and arrays, in the dataclasses and named tuples of
    `hint` again. KeyError, TypeError or ValueError if it has not their shape.
    """
    if get_origin(hint) is UnionType:
        kinds = [kind for kind in get_args(hint) if kind is not type(None)]
        return None if value is None else rebuilt(value, kinds[0])
    if get_origin(hint) is tuple and get_args(hint)[1:] == (Ellipsis,):
        return tuple([rebuilt(part, get_args(hint)[0]) for part in value])
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        names = [item.name for item in fields(hint)]
        return hint(**{name: rebuilt(value[name], hints[name]) for name in names})  # type: ignore[operator]
    if hasattr(hint, "_fields"):
        pairs = zip(value, get_type_hints(hint).values(), strict=True)
        return hint(*(rebuilt(part, kind) for part, kind in pairs))
    return tuple(value) if isinstance(value, list) else value


def _parts(value: Any) -> dict[str, Any]:
    """A dataclass as a map; what is in it msgpack comes to by itself, and copies nothing."""
    return {name: getattr(value, name) for name in value.__dataclass_fields__}


def _checked(data: bytes) -> tuple[dict[str, Any], dict[str, int]]:
    if zlib.crc32(data[4:]).to_bytes(4, "little") != data[:4]:
        raise ValueError("its checksum does not fit")
    values, marks = msgpack.unpackb(data[4:], use_list=False)
    return values, marks
