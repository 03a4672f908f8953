"""The colours of the page, for every other thing that is drawn."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

SHEET = Path(__file__).parents[1] / "dash" / "page" / "colours.css"


@cache
def light() -> dict[str, str]:
    """Colour (#rrggbb) by name, as on white."""
    text = SHEET.read_text(encoding="utf-8").partition("[data-theme")[0]
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})\b", text))
