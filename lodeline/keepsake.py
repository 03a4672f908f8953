"""A node's state on file, so that its successor after a crash goes on where it stood.

The file lies in the run folder, is replaced as a whole, and outlives the process, not a power cut.
"""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import msgpack

from lodeline.node import Node


class Keepsake:
    """The state file of one node: `store` it now and then, `restore` it once at the start."""

    def __init__(self, node: Node[Any], folder: Path) -> None:
        self._node = node
        self._file = folder / f"{node.context.name}.msgpack"
        self._stored = b""

    def store(self) -> None:
        """Write the node's state if it has one and it changed."""
        state = self._node.save()
        if state is None:
            return
        data = msgpack.packb(asdict(state))
        if data != self._stored:
            self._stored = data
            part = self._file.with_suffix(".part")
            part.write_bytes(data)
            part.replace(self._file)

    def restore(self) -> bool:
        """Hand the state on file to the node; whether there was one it could take."""
        kind = type(self._node).State
        if kind is None or not self._file.exists():
            return False
        try:
            values = msgpack.unpackb(self._file.read_bytes(), use_list=False)
            state = kind(**{item.name: values[item.name] for item in fields(kind)})
            self._node.resume(state)
        except (ValueError, KeyError, TypeError) as error:
            print(f"STATE_LOST {self._file.name}: {error}; starting afresh", flush=True)
            return False
        return True
