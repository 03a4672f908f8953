"""Sending a recording to a running pipeline."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping

from lodeline.bus import BusError, Publisher, wait_watched
from lodeline.recording import RecordingError
from lodeline.recording.play import Choice, Played, play
from lodeline.recording.read import Recording
from lodeline.run_folder import Running
from lodeline.sessions import Client
from lodeline.terminal.transport import Transport
from lodeline.watch import Watch
from lodeline_msgs import encoding_of

MATCH_S = 3.0


def send(
    recording: Recording,
    choice: Choice,
    target: Running,
    *,
    rate: float = 1.0,
    begin: float = 0.0,
    loop: bool = False,
) -> Played:
    """Play the chosen keys from `begin` [s] on, for ever if `loop`.

    RecordingError if the pipeline cannot take them: its time comes from recordings and has gone
    by, or it keeps the host's time and cannot go at another rate, or nobody listens.
    """
    keeps_stamps = target.manifest.clock == "recording"
    if not keeps_stamps and rate != 1.0:
        raise RecordingError(
            f"--rate {rate:g} needs a pipeline with `clock: recording`: {target.manifest.name} "
            "measures ages by the host's time"
        )
    if keeps_stamps and loop:
        raise RecordingError(
            f"--loop: {target.manifest.name} takes its time from the recording, and time cannot "
            "go back"
        )
    first, last = recording.span
    since = first + int(begin * 1e9)
    if since > last:
        raise RecordingError(f"--start {begin:g}: it lasts {(last - first) * 1e-9:g} s")
    if keeps_stamps:
        _refuse_second(target, choice.types)
    try:
        client = Client(target.folder)
    except BusError as error:
        raise RecordingError(f"{target.manifest.name} cannot be reached: {error}") from None
    try:
        publishers = _publishers(client, target, choice)
        with Transport(first, last) as transport:
            played = Played(0, 0.0)
            for _ in itertools.count() if loop else range(1):
                once = play(
                    recording.packed(choice.types, since),
                    choice.types,
                    lambda key, data: publishers[key].put(data),
                    rate=rate,
                    start=None if keeps_stamps else time.time_ns(),
                    look=transport.look,
                )
                played = Played(played.samples + once.samples, max(played.latest, once.latest))
    finally:
        client.close()
    return played


def _publishers(client: Client, target: Running, choice: Choice) -> dict[str, Publisher]:
    publishers = {
        key: client.publisher(f"{target.manifest.name}/{key}", encoding_of(cls))
        for key, cls in choice.types.items()
    }
    if waiting := wait_watched(list(publishers.values()), MATCH_S):
        raise RecordingError(f"no node listens to {', '.join(waiting)}: nothing played")
    return publishers


def _refuse_second(target: Running, keys: Mapping[str, object]) -> None:
    """A pipeline whose time comes from recordings cannot go back to the start of another one."""
    with Watch(target) as watch:
        full = [f"{target.manifest.name}/{key}" for key in keys]
        for status in watch.statuses(MATCH_S).values():
            if any(status.received.get(key) for key in full):
                raise RecordingError(
                    f"{target.manifest.name} has played a recording already and stands at its end: "
                    "start it again with `lodeline up`"
                )
