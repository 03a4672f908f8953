"""One number of a sample as a term over the columns of a table: `-sum(enc_left)`, `gx * deg`.

A term is a column, with a sign, and with a factor or the name of a unit if it is not in SI yet;
`sum(column)` adds up what is given as differences; a bare number is a constant.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from math import inf, isfinite, pi

UNITS = {
    "deg": pi / 180.0,
    "rpm": pi / 30.0,
    "g": 9.80665,
    "uT": 1e-6,
    "gauss": 1e-4,
    "mm": 1e-3,
    "cm": 1e-2,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
}
"""Factors to SI by the names that a term may give them."""

_SUM = re.compile(r"sum\((.*)\)")


@dataclass(frozen=True, slots=True)
class Term:
    """`factor` times a column, or times the sum of it so far; `factor` alone without a column."""

    column: str | None
    factor: float
    summed: bool = False


def parse(text: str | float, columns: Collection[str]) -> Term:
    """The term that a text or number means; ValueError, with the columns there are, if none."""
    if isinstance(text, int | float):
        if isinstance(text, bool) or not isfinite(text):
            raise ValueError("expected a column or a number")
        return Term(None, float(text))
    rest, factor = text.strip(), 1.0
    if rest not in columns and "*" in rest:
        rest, _, word = (part.strip() for part in rest.rpartition("*"))
        factor = _factor(word)
    if rest not in columns and rest.startswith("-"):
        rest, factor = rest[1:].strip(), -factor
    summed = rest not in columns and _SUM.fullmatch(rest)
    if summed:
        rest = summed[1].strip()
    if rest not in columns:
        from lodeline.params import nearest

        raise ValueError(f"no column {rest!r}{nearest(rest, columns)}")
    return Term(rest, factor, bool(summed))


def _factor(word: str) -> float:
    if word in UNITS:
        return UNITS[word]
    try:
        factor = float(word)
    except ValueError:
        factor = inf
    if not isfinite(factor):
        raise ValueError(f"{word!r} is no number and no unit ({', '.join(UNITS)})")
    return factor
