"""Drives a whole robot on bus 9, as the nodes do, and prints what it read; run by a test."""

from __future__ import annotations

import json
import sys
import time

from lodeline.devices import Encoders, ImuBoard, MpuParams, ReedBar
from lodeline.i2c import Bus


def main(fifo: bool) -> None:
    bus = Bus(9)
    board = ImuBoard(bus, time.monotonic, MpuParams(fifo=fifo))
    encoders, bar = Encoders(bus), ReedBar(bus)
    samples: list[tuple[int, tuple[float, float, float]]] = []
    fields: list[tuple[float, float, float] | None] = []
    counts: list[tuple[int, int] | None] = []
    reeds: list[int | None] = []
    enough = 900 if fifo else 80
    begin = now = time.monotonic()
    while now < begin + 1.5 or (len(samples) < enough and now < begin + 15.0):
        now = time.monotonic()
        readings, field = board.read(round(now * 1e9))
        samples += [(stamp, reading.linear_acceleration) for stamp, reading in readings]
        fields.append(field)
        counts.append(encoders.read(now))
        reeds.append(bar.read(now))
        time.sleep(0.01)
    said = {
        "samples": samples,
        "fields": [field for field in fields if field is not None],
        "counts": [count for count in counts if count is not None],
        "reeds": [closed for closed in reeds if closed is not None],
        "health": [board.health.state, encoders.health.state, bar.health.state],
        "messages": [board.health.message, encoders.health.message, bar.health.message],
    }
    print(json.dumps(said))


if __name__ == "__main__":
    main(sys.argv[1:] == ["fifo"])
