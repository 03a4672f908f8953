"""The page in the user's browser, if there is one to be seen."""

from __future__ import annotations

import asyncio
import os
import sys
import webbrowser

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
"""Without any of these a browser would take the terminal, if it came up at all."""


async def open_page(url: str) -> None:
    """Show a link; where that is not possible, say that the user has to."""
    seen = sys.platform == "darwin" or any(os.environ.get(name) for name in SCREENS)
    if not (seen and await asyncio.to_thread(webbrowser.open, url)):
        print("no browser to be seen here: open the link yourself", file=sys.stderr, flush=True)
