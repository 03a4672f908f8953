"""The run of a live recorder: from the first sample to whatever ends it."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from lodeline.recording.record import QUEUE, Recorder
from lodeline.recording.write import FLUSH_S
from lodeline.watch import PATIENCE_S, NothingThereError, Watch

SETTLE_S = 3.0
"""What is still asked for at the end is waited for so long."""
INTERRUPTED, OVER, GONE, FULL = "interrupted", "time is over", "the pipeline ended", "disk full"


def record_live(
    watch: Watch,
    recorder: Recorder,
    seconds: float | None,
    interrupted: threading.Event,
    progress: Callable[[float], None],
) -> str:
    """Record until interrupted, for `seconds` [s], or until the pipeline or the disk ends.

    Says why it ended; the file is closed. `progress(elapsed)` is called twice a second.
    """
    begun = time.monotonic()
    end = GONE
    try:
        # One ring for each key that was chosen, or one for all: that keeps their order too.
        name, flows = watch.manifest.name, recorder.flows
        keys = [f"{name}/{key}" for key in flows]
        for key in keys if len(flows) < len(watch.all_keys()) else [f"{name}/**"]:
            watch.subscribe(key, QUEUE, recorder.take)
        patient = True
        for _ in watch.ticks(0.0):
            left = FLUSH_S if seconds is None else min(FLUSH_S, begun + seconds - time.monotonic())
            if left <= 0.0 or recorder.stopped.is_set() or interrupted.wait(left):
                end = FULL if recorder.stopped.is_set() else OVER if left <= 0.0 else INTERRUPTED
                break
            recorder.tend()
            if recorder.room.news:
                print(recorder.room.news, file=sys.stderr, flush=True)
            _say_gaps(recorder)
            elapsed = time.monotonic() - begun
            progress(elapsed)
            if patient and elapsed > PATIENCE_S and not recorder.samples:
                print(f"waiting for a sample of {', '.join(flows)}", file=sys.stderr, flush=True)
                patient = False
        if recorder.gaps is not None and end != FULL:
            recorder.gaps.settle(SETTLE_S)
    except NothingThereError:
        pass  # what it sent is in the file
    finally:
        recorder.close(end)
    _say_gaps(recorder)
    return end


def _say_gaps(recorder: Recorder) -> None:
    for line in recorder.gaps.news() if recorder.gaps is not None else ():
        print(line, file=sys.stderr, flush=True)


class Interrupted(threading.Event):
    """Set by Ctrl-C or SIGTERM; `by_hand` if it was Ctrl-C."""

    by_hand = False


@contextmanager
def interrupts() -> Iterator[Interrupted]:
    """An event that Ctrl-C and SIGTERM set, while in the context."""
    interrupted = Interrupted()

    def handler(number: int, _frame: FrameType | None) -> None:
        interrupted.by_hand = number == signal.SIGINT
        interrupted.set()

    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield interrupted
    finally:
        for number, handler_before in before.items():
            signal.signal(number, handler_before)
