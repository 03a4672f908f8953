"""One stage of a chain on zenoh alone: unpacks each sample, packs it again, sends it on.

Nothing of ours is in its way. `tuned` takes the settings that our bus takes, so that the rest of
the difference is our own doing; otherwise zenoh is as it comes.
"""

from __future__ import annotations

import argparse
import json
import os
import threading
import time
from collections.abc import Callable
from typing import Any

import msgpack
import zenoh

from lodeline.bench.chain.ends import SAMPLE, Heard, Sent, Stop, paced

PATIENCE_S = 20.0


def main() -> None:
    """Be one stage until SIGTERM."""
    arguments = parser().parse_args()
    stop = Stop()
    session = zenoh.open(config(arguments.folder, arguments.stage, arguments.tuned))
    try:
        if arguments.stage == 0:
            source(session, arguments, stop)
        elif arguments.stage == arguments.last:
            heard = sink(session, arguments.folder, arguments.last - 1, arguments.tuned)
            stop.wait()
            heard.write()
        else:
            publisher = declare(session, arguments.stage)
            put, pack, unpack = publisher.put, packer(), msgpack.unpackb
            subscribe(
                session,
                arguments.stage - 1,
                lambda data: put(pack(unpack(data))),
                arguments.tuned,
            )
            stop.wait()
    finally:
        os._exit(0)


def parser() -> argparse.ArgumentParser:
    """What a stage takes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    parser.add_argument("--stage", type=int, required=True)
    parser.add_argument("--last", type=int, required=True)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--tuned", action="store_true")
    return parser


def config(folder: str, stage: int, tuned: bool) -> zenoh.Config:
    """Each stage listens, and is linked with the one before it."""
    made = zenoh.Config()
    values: dict[str, Any] = {
        "mode": "peer",
        "listen/endpoints": [endpoint(folder, stage)],
        "connect/endpoints": [endpoint(folder, stage - 1)] if stage else [],
        "connect/timeout_ms": -1,
        "connect/retry": {"period_init_ms": 50, "period_max_ms": 50, "period_increase_factor": 1},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }
    if tuned:
        values["transport/shared_memory/enabled"] = False
    for key, value in values.items():
        made.insert_json5(key, json.dumps(value))
    return made


def endpoint(folder: str, stage: int) -> str:
    """Where a stage listens."""
    return f"unixsock-stream/{folder}/{stage}.sock"


def declare(session: zenoh.Session, stage: int) -> zenoh.Publisher:
    """The publisher of a stage."""
    return session.declare_publisher(f"bench/{stage}")


def packer() -> Callable[[Any], bytes]:
    """msgpack's own, used again and again."""
    pack: Callable[[Any], bytes] = msgpack.Packer(autoreset=True).pack
    return pack


def subscribe(
    session: zenoh.Session, stage: int, take: Callable[[bytes], None], tuned: bool
) -> None:
    """Take what a stage sends: by callback, or from a ring in a thread of our own."""
    key = f"bench/{stage}"
    if not tuned:
        session.declare_subscriber(key, lambda sample: take(sample.payload.to_bytes()))
        return
    subscriber: Any = session.declare_subscriber(key, zenoh.handlers.RingChannel(256))

    def run() -> None:
        while True:
            take(subscriber.recv().payload.to_bytes())

    threading.Thread(target=run, daemon=True).start()


def source(session: zenoh.Session, arguments: argparse.Namespace, stop: Stop) -> None:
    """Send samples at a rate, once somebody listens."""
    publisher, pack, sent = declare(session, 0), packer(), Sent(arguments.folder)
    wait_matched(publisher)
    for number in paced(arguments.rate, stop):
        stamp = time.monotonic_ns()
        publisher.put(pack(SAMPLE | {"stamp": stamp, "seq": number}))
        sent.add(stamp)
    sent.write()


def wait_matched(publisher: zenoh.Publisher) -> None:
    """Until somebody listens."""
    end = time.monotonic() + PATIENCE_S
    status: Any = publisher.matching_status
    while not status.matching and time.monotonic() < end:
        time.sleep(0.01)
        status = publisher.matching_status


def sink(session: zenoh.Session, folder: str, stage: int, tuned: bool) -> Heard:
    """Unpack and note what a stage sends."""
    heard = Heard(folder)

    def take(data: bytes) -> None:
        stamp = msgpack.unpackb(data)["stamp"]
        heard.add(stamp, time.monotonic_ns())

    subscribe(session, stage, take, tuned)
    return heard


if __name__ == "__main__":
    main()
