"""Node programs as classes: a file is run by path, so it is also imported by path."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

from lodeline.node import Node

SHIPPED = Path(__file__).resolve().parent


def shipped(name: str) -> Path:
    """A file or folder that ships with Lodeline, in a checkout or in an installed wheel."""
    inside = SHIPPED / name
    return inside if inside.exists() else SHIPPED.parent / name


def load_node(file: Path) -> type[Node[Any]]:
    """The one node class that a file defines.

    Raises whatever importing the file raises, and TypeError if it defines none or several.
    """
    name = f"lodeline_node_{file.stem}_{abs(hash(str(file.resolve()))):x}"
    module = sys.modules.get(name)
    if module is None:
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise TypeError(f"{file} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    classes = [
        item
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, Node) and item.__module__ == name
    ]
    if len(classes) != 1:
        found = ", ".join(item.__name__ for item in classes) or "none"
        raise TypeError(f"{file} must define exactly one node class, found {found}")
    return classes[0]
