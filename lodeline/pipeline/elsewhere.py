"""A pipeline file read in a process of its own.

What reading takes (YAML, the programs of all nodes) ends with that process, and goes on while
the one that wants the pipeline gets ready for it: the supervisor, which lives long.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
from collections.abc import Sequence

from lodeline.pipeline.faults import Fault, PipelineError
from lodeline.pipeline.model import Pipeline

_PDEATHSIG = 1


class Reading:
    """A file that is being read. To be made before there are threads, by their main thread."""

    def __init__(self, name_or_path: str | None, overrides: Sequence[str]) -> None:
        self._what = name_or_path, overrides
        self._reader, writer = os.pipe()
        parent = os.getpid()
        self._pid = os.fork()
        if self._pid == 0:
            os.close(self._reader)
            _read(name_or_path, overrides, writer, parent)
        os.close(writer)

    def pipeline(self) -> Pipeline:
        """What is in it, without the programs; PipelineError with everything that is wrong.

        SystemExit if the process that read it died, of which it has told on standard error.
        """
        with os.fdopen(self._reader, "rb") as end:
            data = end.read()
        _, status = os.waitpid(self._pid, 0)
        if status:
            if os.WIFSIGNALED(status):
                name = signal.Signals(os.WTERMSIG(status)).name
                print(f"a node's program ended the reading of the file by {name}", file=sys.stderr)
            sys.exit(1)
        try:
            found = pickle.loads(data)  # noqa: S301 - our own process wrote it
        except (ImportError, AttributeError):  # a message that a node's program defines for itself
            found = _load(*self._what)
        if isinstance(found, Pipeline):
            return found
        raise PipelineError(found)


def _load(name_or_path: str | None, overrides: Sequence[str]) -> Pipeline | list[Fault]:
    from lodeline.pipeline.load import find, load

    try:
        return load(find(name_or_path), overrides).without_programs()
    except PipelineError as error:
        return error.faults


def _read(name_or_path: str | None, overrides: Sequence[str], writer: int, parent: int) -> None:
    """Be the process that reads, and end."""
    code = 1
    try:
        ctypes.CDLL(None).prctl(_PDEATHSIG, signal.SIGKILL)  # a program may hang for ever
        if os.getppid() != parent:
            return
        found = pickle.dumps(_load(name_or_path, overrides))
        with os.fdopen(writer, "wb") as end:
            end.write(found)
        code = 0
    except KeyboardInterrupt:
        pass
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
