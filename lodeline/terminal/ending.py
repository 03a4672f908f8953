"""How a command on a recording ends: what is wrong is told in a sentence and is an exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable

from lodeline.plotting import NoMatplotlibError, NothingToPlotError
from lodeline.recording import NoRecordingError, RecordingError

FAILED, NOTHING = 1, 4


def ended(work: Callable[[], int]) -> int:
    """The exit code of `work`: its own, or that of the error which ended it."""
    try:
        return work()
    except BrokenPipeError:
        raise  # `| head` is no fault: the command line knows
    except (NoRecordingError, NothingToPlotError) as error:
        print(error, file=sys.stderr)
        return NOTHING
    except (RecordingError, NoMatplotlibError) as error:
        print(error, file=sys.stderr)
        return FAILED
    except OSError as error:
        print(f"{error.filename or 'output'}: {error.strerror or error}", file=sys.stderr)
        return FAILED
