"""What a student's file may do to the program that runs it: not load, raise, end it, never end."""

from __future__ import annotations

import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

PATIENCE = 30.0
"""Seconds for a file; the solution needs one."""


class GradingError(Exception):
    """A file that cannot be graded at all: it does not load, is another node, or never ends."""


class _Endless(BaseException):
    """No Exception: neither the file nor the graph takes it for an error of a handler."""


@contextmanager
def patience(file: Path) -> Iterator[None]:
    """GradingError where the file's code calls exit(), or goes on for PATIENCE."""

    def give_up(*_: object) -> NoReturn:
        raise _Endless

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    except SystemExit as error:
        raise GradingError(f"{file} ends the program: {where(error, file)}") from None
    except _Endless as error:
        place = where(error, file).partition(":")[0]
        text = f"not done after {PATIENCE:.0f} s, at {place}: does a loop there never end?"
        raise GradingError(f"{file}: {text}") from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def where(error: BaseException, file: Path) -> str:
    """What was raised, and the line of the student's file."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).resolve() == file.resolve()]
    if isinstance(error, SyntaxError):
        lines = [error.lineno]
    return f"{f'line {lines[-1]}: ' if lines else ''}{type(error).__name__}: {error}"
