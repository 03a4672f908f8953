"""What a plot is made of, before anything draws it: curves, bands, limits, panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

Values = Sequence[float]
Colour = Literal["ekf", "odom", "truth", "hit", "ink-2", "ink-3", "bad", "magnet"]
"""By what is shown: names of the page's palette, told apart by every kind of colour vision."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Points (x, y), or (t, x, y) on the floor; None in y breaks the line."""

    name: str
    colour: Colour
    x: Values
    y: Sequence[float | None]
    style: Literal["line", "dots"] = "line"
    dashed: bool = False
    faint: bool = False
    t: Values = ()


@dataclass(frozen=True, slots=True)
class Band:
    """What lies between two curves over the same x."""

    name: str
    colour: Colour
    x: Values
    low: Values
    high: Values


@dataclass(frozen=True, slots=True)
class Limit:
    """A value that something is held against, all the way across."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes over time: what is on them, its unit, and its drawings.

    `rows` are names of the whole numbers from 1 on where the axis counts things; `spans` are
    (row, begin, end). `log` is for values that are never negative and span decades.
    """

    label: str
    unit: str
    curves: tuple[Curve, ...] = ()
    bands: tuple[Band, ...] = ()
    limits: tuple[Limit, ...] = ()
    log: bool = False
    rows: tuple[str, ...] = ()
    spans: tuple[tuple[int, float, float], ...] = ()


class Ellipse(NamedTuple):
    """Centre and half axes [m], and the direction of the first of them [rad]."""

    x: float
    y: float
    a: float
    b: float
    angle: float


@dataclass(frozen=True, slots=True)
class Floor:
    """The ground seen from above, x east and y north [m]; `seen` are magnets that were met."""

    trails: tuple[Curve, ...]
    ellipses: tuple[Ellipse, ...] = ()
    magnets: tuple[tuple[float, float], ...] = ()
    seen: tuple[tuple[float, float], ...] = ()
    hits: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Figure:
    """One plot: panels over a common time [s], or the floor. `kind` names its file."""

    kind: str
    title: str
    note: str
    panels: tuple[Panel, ...] = ()
    floor: Floor | None = None
