"""What is wrong with a pipeline file, and where: `pipeline.yaml:14:5: what, and the right name`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong; line and column count from 1, line 0 is the file as a whole."""

    file: str
    line: int
    column: int
    text: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        return f"{place}: {self.text}"


@dataclass(frozen=True, slots=True)
class Place:
    """Where something stands: in a file, or (line 0) in an argument of the command line."""

    file: str
    line: int = 0
    column: int = 0

    def fault(self, text: str) -> Fault:
        return Fault(self.file, self.line, self.column, text)


class PipelineError(Exception):
    """A pipeline cannot run; `faults` holds everything that is wrong, sorted by place."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        unique = dict.fromkeys(faults)
        self.faults = sorted(unique, key=lambda fault: (fault.line, fault.column))
        super().__init__(*self.faults)

    def __str__(self) -> str:
        return "\n".join(str(fault) for fault in self.faults)
