"""What is said in a run: on the terminal, on disk, and kept for whoever asks over the bus."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from lodeline.sessions import Hub
from lodeline.supervisor.log_files import LogFiles
from lodeline.supervisor.logbook import LogBook
from lodeline.supervisor.logs import Console


class RunLog:
    """The three of them; `console` is where lines come in, `folder` is that of the files."""

    def __init__(self, names: Sequence[str], folder: Path) -> None:
        self._book = LogBook()
        self._files = LogFiles(folder, self.event)
        coloured = sys.stderr.isatty() and not os.environ.get("NO_COLOR")
        self.console = Console(sys.stderr.fileno(), [*names], coloured, self._keep)

    def event(self, text: str) -> None:
        """A line of the supervisor's own."""
        self.console.event(text)

    def publish(self, hub: Hub, key: str) -> None:
        """Send new lines on a key of the bus, and answer there with those that are kept."""
        hub.serve(key, self._book.kept)
        self._book.publish(hub.publisher(key, "application/json"))

    def unpublish(self) -> None:
        """Send what is left, while there is a bus."""
        self._book.close()

    def close(self) -> None:
        """Write what is left."""
        self._files.close()
        self.console.close()

    def _keep(self, name: str, text: str) -> None:
        self._book.add(name, text)
        self._files.add(name, text)
