"""From the bus into a viewer: all samples that are drawn, of one run after another."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable

from lodeline.ekf import LocalizerParams
from lodeline.pipeline.load import load_unchanged
from lodeline.recording.localizer import params_of
from lodeline.run_folder import Running, running
from lodeline.viewers.drawing import Canvas, Drawing
from lodeline.watch import NothingThereError, Watch
from lodeline_msgs import DecodeError, class_of, unpack

DRAWN = ("PoseEstimate", "Odometry", "AttitudeEstimate", "MagnetDetection")
QUEUE = 64
LOOK_S = 0.25


def feed(name: str, canvas: Canvas, seconds: float | None, interrupted: threading.Event) -> None:
    """Show the pipeline of that name until interrupted, or for `seconds` [s].

    While it is away the canvas stands still; the next run of it is shown as well.
    """
    end = float("inf") if seconds is None else time.monotonic() + seconds

    def over() -> bool:
        left = end - time.monotonic()
        return left <= 0.0 or interrupted.wait(min(LOOK_S, left))

    told = False
    while not over():
        found = running(name)
        if not found:
            if not told:
                print(f"{name} is away: waiting for it", file=sys.stderr, flush=True)
            told = True
            continue
        told = False
        try:
            _show(found[0], canvas, over)
        except NothingThereError:
            continue  # its hub is not there yet, or no more


def _show(target: Running, canvas: Canvas, over: Callable[[], bool]) -> None:
    manifest = target.manifest
    runs = load_unchanged(manifest.file, manifest.digest, manifest.overrides)
    params = params_of(runs) or LocalizerParams()
    types = {key: known.type for key, known in target.keys().items() if known.type in DRAWN}
    drawing, lock = Drawing(canvas, params, types), threading.Lock()
    prefix = f"{manifest.name}/"

    def take(key: str, data: bytes, encoding: str) -> None:
        try:
            message = unpack(data, class_of(encoding))
        except DecodeError:
            return  # the node that should have it counts and tells it
        with lock:
            drawing.take(key.removeprefix(prefix), message)

    with Watch(target) as watch:
        for key in types:
            watch.subscribe(prefix + key, QUEUE, take)
        while watch.still_there() and not over():
            pass
