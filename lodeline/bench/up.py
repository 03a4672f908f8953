"""One `lodeline up` that a bench starts in a run folder of its own, and nobody listens to."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Self

from lodeline.run_folder import VARIABLE, Running, running

START_S, STOP_S = 60.0, 20.0


class Up:
    """`with Up(text) as up:` a pipeline that runs; `{folder}` in its text is a place for files."""

    def __init__(self, text: str) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="llu", ignore_cleanup_errors=True)
        self.folder = Path(self._temporary.name)
        self.environment = {**os.environ, VARIABLE: str(self.folder / "run"), "NO_COLOR": "1"}
        file, self._log = self.folder / "pipeline.yaml", self.folder / "log"
        file.write_text(text.replace("{folder}", str(self.folder)))
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "lodeline", "up", str(file)],
                env=self.environment,
                stderr=log,
            )

    def __enter__(self) -> Self:
        end = time.monotonic() + START_S
        while "up in " not in (log := self._log.read_text()):
            if self.process.poll() is not None or time.monotonic() > end:
                self.close()
                raise RuntimeError(f"the pipeline did not come up:\n{log}")
            time.sleep(0.02)
        return self

    @property
    def running(self) -> Running:
        """Where it runs, and what."""
        (found,) = running(base=self.folder / "run")
        return found

    def stop(self) -> None:
        """As by Ctrl-C; files that its nodes write at the end are there then."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def close(self) -> None:
        self.stop()
        self._temporary.cleanup()

    def __exit__(self, *_: object) -> None:
        self.close()
