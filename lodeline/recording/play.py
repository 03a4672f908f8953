"""Playing a recording back in time: which keys, when each sample is due, and with what stamp."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from lodeline.recording import RecordingError
from lodeline.recording.read import Packed, Recording
from lodeline_msgs import Message, pack, unpack

Put = Callable[[str, bytes], None]
LOOK_S = 0.1


class Played(NamedTuple):
    """Samples that went out, and how late [s] the latest of them was."""

    samples: int
    latest: float


class Choice(NamedTuple):
    """Keys to play, with their class, and those left out because a running node sends them."""

    types: dict[str, type[Message]]
    left_out: dict[str, str]


def choose(
    recording: Recording,
    external: Mapping[str, str],
    sent: Mapping[str, str],
    only: Collection[str] = (),
) -> Choice:
    """The recorded keys that a pipeline takes from outside; `only` these, if there are any.

    `external` is key to class name, `sent` key to the node that sends it. A key that a running
    node sends is never played: two sources on one key cannot be told apart. RecordingError if
    nothing is left to play, or a class is not the one the pipeline takes.
    """
    types: dict[str, type[Message]] = {}
    for key, wanted in external.items():
        info = recording.channels.get(key)
        if info is None or (only and key not in only):
            continue
        if info.type is None or info.type_name != wanted:
            raise RecordingError(f"{key} is {info.type_name} here, the pipeline takes {wanted}")
        types[key] = info.type
    left_out = {
        key: sent[key] for key in recording.channels if key in sent and (not only or key in only)
    }
    if not types:
        there = ", ".join(recording.channels) or "no keys"
        lines = [f"{recording.path} has no key that the running pipeline takes from outside"]
        lines.append(f"it has {there}; the pipeline takes {', '.join(external) or 'none'}")
        lines += [f"{key} comes from its node {node} already" for key, node in left_out.items()]
        lines.append(
            "it goes into one that has its keys as `external:`, as `lodeline up magnet-lab`"
        )
        raise RecordingError("\n".join(lines))
    return Choice(types, left_out)


def shifted(packed: Packed, cls: type[Message], shift: int) -> bytes:
    """The bytes of a sample with its stamp moved by `shift` [ns]; untouched for 0."""
    if shift == 0:
        return packed.data
    message = unpack(packed.data, cls)
    return pack(replace(message, stamp=message.stamp + shift))


def play(
    samples: Iterable[Packed],
    types: Mapping[str, type[Message]],
    put: Put,
    *,
    rate: float = 1.0,
    start: int | None = None,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    look: Callable[[int], float] = lambda _log_time: 0.0,
) -> Played:
    """Put each sample when it is due: its distance in log time from the first, over `rate`.

    Deadlines are absolute, so delays do not add up. `start` [ns] is the stamp that the first
    sample gets, all others move with it; None leaves the stamps as they are. `look(log_time)` is
    called before each sample and at least ten times a second; it may hold the play up, and says
    for how long [s] it did.
    """
    count, latest, shift = 0, 0.0, 0
    begin, first = 0.0, None
    for packed in samples:
        if first is None:
            begin, first = now(), packed.log_time
            if start is not None:
                shift = start - unpack(packed.data, types[packed.key]).stamp
        due = begin + (packed.log_time - first) * 1e-9 / rate
        data, held = shifted(packed, types[packed.key], shift), look(packed.log_time)
        while (ahead := due + held - now()) > 0.0:
            sleep(min(ahead, LOOK_S))
            held += look(packed.log_time)
        begin += held
        put(packed.key, data)
        latest = max(latest, -ahead)
        count += 1
    return Played(count, latest)
