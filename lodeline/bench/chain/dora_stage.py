"""One stage of the same chain on dora-rs: unpacks each sample, packs it again, sends it on."""

from __future__ import annotations

import os
import signal
import threading
import time
from importlib import import_module
from typing import Any

import msgpack

from lodeline.bench.chain.ends import SAMPLE, Heard, Sent, Stop, paced
from lodeline.bench.chain.raw import packer, parser


def main() -> None:
    """Be one stage until dora says STOP."""
    arguments = parser().parse_args()
    node, stop, pack = import_module("dora").Node(), Stop(), packer()
    if arguments.stage == 0:
        sent = Sent(arguments.folder)
        threading.Thread(target=watch, args=(node,), daemon=True).start()
        for number in paced(arguments.rate, stop):
            stamp = time.monotonic_ns()
            node.send_output("out", pack(SAMPLE | {"stamp": stamp, "seq": number}))
            sent.add(stamp)
        sent.write()
    elif arguments.stage == arguments.last:
        heard = Heard(arguments.folder)
        for data in inputs(node):
            heard.add(msgpack.unpackb(data)["stamp"], time.monotonic_ns())
        heard.write()
    else:
        for data in inputs(node):
            node.send_output("out", pack(msgpack.unpackb(data)))
    os._exit(0)


def inputs(node: Any) -> Any:
    """Payloads until STOP."""
    for event in node:
        if event["type"] == "INPUT":
            value = event["value"]
            whole = value.buffers()[1].to_pybytes()
            yield whole[value.offset : value.offset + len(value)]
        elif event["type"] == "STOP":
            return


def watch(node: Any) -> None:
    """A source has no inputs, but must see STOP."""
    for event in node:
        if event["type"] == "STOP":
            os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
