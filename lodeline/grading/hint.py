"""What to tell about a wrong answer: each function as written, tried beside the right one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, pi, remainder
from types import ModuleType
from typing import Any

from lodeline.grading.exercise import Part

NEAR = 1e-9
"""Of the numbers as they are, in SI: less than any mistake, more than any rounding."""
Rows = list[list[float]]


def hint(parts: Sequence[Part], written: ModuleType, solved: ModuleType) -> str:
    """The first part that is not right: which known mistake it is, or an example; "" if none."""
    for part in parts:
        function = getattr(written, part.name, None)
        right = getattr(solved, part.name)
        found = _of_part(part, function, right) if callable(function) else ""
        if found:
            return found
    return ""


def _of_part(part: Part, written: Callable[..., Any], right: Callable[..., Any]) -> str:
    try:
        answers = [written(*arguments) for arguments in part.tries]
    except Exception:
        return ""  # told with its line where it was raised
    wanted = _results(part, right)
    for answer, want in zip(answers, wanted, strict=True):
        if answer is None:
            return f"{part.name} gives None: is its `return` missing?"
        if list(map(len, _rows(answer))) != list(map(len, want)):
            return f"{part.name} gives {_given(answer)}, {_asked(want)} asked for"
    numbers = list(map(_rows, answers))
    if _same(part, numbers, wanted):
        return ""
    for mistake, text in part.mistakes:
        if _same(part, numbers, _results(part, mistake)):
            return text
    tries = zip(part.tries, numbers, wanted, strict=True)
    arguments, got, want = next(each for each in tries if not _same(part, [each[1]], [each[2]]))
    call = f"{part.name}({', '.join(map(_argument, arguments))})"
    return f"{call} gives {_shown(got)}, should be {_shown(want)}"


def _results(part: Part, function: Callable[..., Any]) -> list[Rows]:
    return [_rows(function(*arguments)) for arguments in part.tries]


def _rows(answer: Any) -> Rows:
    """A number, some numbers, or rows of them, as rows; none if it is anything else."""
    try:
        if not hasattr(answer, "__iter__"):
            return [[float(answer)]]
        parts = list(answer)
        if any(hasattr(part, "__iter__") for part in parts):
            return [[float(number) for number in part] for part in parts]
        return [[float(number) for number in parts]]
    except (TypeError, ValueError):
        return []


def _same(part: Part, some: Sequence[Rows], others: Sequence[Rows]) -> bool:
    pairs = (
        (number, other)
        for rows, other_rows in zip(some, others, strict=True)
        for row, other_row in zip(rows, other_rows, strict=True)
        for number, other in zip(row, other_row, strict=True)
    )
    return all(_near(number - other, part.angle) for number, other in pairs)


def _near(off: float, angle: bool) -> bool:
    return abs(remainder(off, 2.0 * pi) if angle and isfinite(off) else off) < NEAR


def _given(answer: Any) -> str:
    rows = _rows(answer)
    if not rows:
        return f"a {type(answer).__name__}"
    if len(rows) > 1:
        return f"{len(rows)} rows of {len(rows[0])}"
    return f"{len(rows[0])} numbers" if len(rows[0]) != 1 else "one number"


def _asked(want: Rows) -> str:
    if len(want) > 1:
        return f"{len(want)} rows of {len(want[0])} are"
    return f"{len(want[0])} are" if len(want[0]) > 1 else "one number is"


def _argument(value: Any) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(map(_argument, value))})"
    return f"{value:.6g}"


def _shown(rows: Rows) -> str:
    return "; ".join(", ".join(f"{number:.6g}" for number in row) for row in rows)
