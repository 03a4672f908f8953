"""Whether the files that a running pipeline was read from were edited since."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lodeline.pipeline.model import Pipeline


def fingerprints(pipeline: Pipeline) -> dict[str, str]:
    """The pipeline file and the programs of its nodes by path, each as 12 hex digits."""
    files = [pipeline.file, *(spec.run for spec in pipeline.nodes)]
    return {str(file): _print(file) for file in files}


def edited(prints: Mapping[str, str]) -> list[str]:
    """Those files of `fingerprints` that are not what they were."""
    return [file for file, was in prints.items() if _print(Path(file)) != was]


def told(files: list[str]) -> str:
    """That these files were edited, in words; empty if there are none."""
    names = ", ".join(Path(file).name for file in files)
    return f"EDITED {names}: takes effect with the next `lodeline up`" if files else ""


def _print(file: Path) -> str:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()[:12]
    except OSError:
        return "gone"
