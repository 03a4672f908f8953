"""The colours of the page, for every other thing that is drawn."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from lodeline.keys import is_truth

SHEET = Path(__file__).parents[1] / "dash" / "page" / "colours.css"


@cache
def light() -> dict[str, str]:
    """Colour (#rrggbb) by name, as on white."""
    text = SHEET.read_text(encoding="utf-8").partition("[data-theme")[0]
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})\b", text))


def colour_of(name: str) -> str:
    """The colour of what is drawn under a name such as `trail/pose`: as on the page."""
    what, _, key = name.partition("/")
    if what in ("magnets", "hits"):
        return light()["magnet" if what == "magnets" else "hit"]
    if what in ("trail", "ellipse"):
        return light()["truth" if is_truth(key) else "odom" if "odom" in key else "ekf"]
    return light()["ekf"]
