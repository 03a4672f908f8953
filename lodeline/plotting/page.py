"""Plots as one HTML file that needs nothing else: no network, no server, no library."""

from __future__ import annotations

import json
import math
from array import array
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any

from lodeline.plotting.figure import Band, Curve, Figure, Floor
from lodeline.plotting.palette import SHEET
from lodeline.recording import RecordingError
from lodeline.recording.write import whole_file

DOCTYPE = b"<!doctype html>"
PAGE = Path(__file__).with_name("page")
SCRIPTS = (
    SHEET.with_name("dom.js"),
    *(PAGE / f"{name}.js" for name in ("axes", "time", "floor", "main")),
)


class Arrays:
    """Numbers as text that a browser unpacks fast, each list once, however often it is used.

    Times and places along x in 64 bits, all else in 32: seven digits.
    """

    def __init__(self) -> None:
        self.packed: list[str] = []
        self._places: dict[tuple[str, int], int] = {}
        self._kept: list[Any] = []  # or another list could take the address of one that is gone

    def add(self, values: Sequence[float | None], exact: bool = False) -> dict[str, int]:
        """What stands for the values in the document."""
        kind = "d" if exact else "f"
        key = (kind, id(values))
        if key not in self._places:
            self._kept.append(values)
            self._places[key] = len(self.packed)
            numbers = array(kind, (math.nan if value is None else value for value in values))
            self.packed.append(kind + b64encode(numbers.tobytes()).decode())
        return {"$": self._places[key]}


def write(
    figures: Sequence[Figure], file: Path, name: str, facts: str, missing: Mapping[str, str]
) -> None:
    """Write the page; `facts` is a line on the recording, `missing` says why plots are not there.

    OSError, RecordingError.
    """
    arrays = Arrays()
    plots = {
        "name": name,
        "facts": facts,
        "span": _span(figures),
        "figures": [_figure(each, arrays) for each in figures],
        "missing": dict(missing),
    }
    data = json.dumps({"plots": plots, "arrays": arrays.packed}, separators=(",", ":"))
    parts = {
        "{title}": escape(f"{name}: plots"),
        "{style}": SHEET.read_text(encoding="utf-8") + _text("plots.css"),
        "{data}": data.replace("<", "\\u003c"),
        "{script}": "\n".join(map(_plain, SCRIPTS)),
    }
    page = _text("plots.html")
    for mark, text in parts.items():
        before, _, after = page.partition(mark)
        page = before + text + after
    if file.is_file() and not _is_page(file):
        raise RecordingError(f"{file} is there already, and no page: give another name")
    with whole_file(file, replace=True) as stream:
        stream.write(page.encode())


def _is_page(file: Path) -> bool:
    with file.open("rb") as stream:
        return stream.read(len(DOCTYPE)).lower() == DOCTYPE


def _text(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")


def _plain(script: Path) -> str:
    """A script of the page as one among others: nothing to export."""
    return script.read_text(encoding="utf-8").replace("\nexport ", "\n")


def _span(figures: Sequence[Figure]) -> tuple[float, float]:
    """First and last time of all that is shown."""
    curves = [each for figure in figures for panel in figure.panels for each in panel.curves]
    ends = [time for each in curves if each.x for time in (each.x[0], each.x[-1])]
    ends += [
        t for f in figures if f.floor for each in f.floor.trails for t in (each.t[0], each.t[-1])
    ]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    return low, high if high > low else low + 1.0


def _figure(figure: Figure, arrays: Arrays) -> dict[str, Any]:
    return {
        "kind": figure.kind,
        "title": figure.title,
        "note": figure.note,
        "panels": [
            {
                "label": panel.label,
                "unit": panel.unit,
                "log": panel.log,
                "rows": panel.rows,
                "spans": panel.spans,
                "curves": [_curve(each, arrays) for each in panel.curves],
                "bands": [_band(each, arrays) for each in panel.bands],
                "limits": [asdict(each) for each in panel.limits],
            }
            for panel in figure.panels
        ],
        "floor": None if figure.floor is None else _floor(figure.floor, arrays),
    }


def _curve(curve: Curve, arrays: Arrays) -> dict[str, Any]:
    return {
        "name": curve.name,
        "colour": curve.colour,
        "style": curve.style,
        "dashed": curve.dashed,
        "faint": curve.faint,
        "x": arrays.add(curve.x, exact=True),
        "y": arrays.add(curve.y),
        "t": arrays.add(curve.t, exact=True),
    }


def _band(band: Band, arrays: Arrays) -> dict[str, Any]:
    return {
        "name": band.name,
        "colour": band.colour,
        "x": arrays.add(band.x, exact=True),
        "low": arrays.add(band.low),
        "high": arrays.add(band.high),
    }


def _floor(floor: Floor, arrays: Arrays) -> dict[str, Any]:
    def points(places: Sequence[tuple[float, float]]) -> dict[str, Any]:
        return {"x": arrays.add([x for x, _ in places]), "y": arrays.add([y for _, y in places])}

    return {
        "trails": [_curve(each, arrays) for each in floor.trails],
        "ellipses": floor.ellipses,
        "magnets": points(floor.magnets),
        "seen": points(floor.seen),
        "hits": points(floor.hits),
    }
