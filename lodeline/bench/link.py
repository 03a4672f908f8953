"""How the link between robot and laptop bears a bad cable, measured on two machines in one.

A cable of our own joins two network namespaces, so it needs root; figures are of 100 Hz odometry
and 200 Hz IMU samples. Every row has a fault, what the laptop got of it, and whether the robot,
listened to at the same time, noticed.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Annotated

from lodeline.bench.cable import Fault
from lodeline.bench.machines import missing
from lodeline.bench.pair import Ear, Heard, Pair
from lodeline.recording.read import Recording
from lodeline.recording.summary import summarize
from lodeline.sessions import Client
from lodeline.tables import table

EXIT_FAILED = 1
SETTLE_S = 1.5
RETURN_S = 8.0
CUTS = (0.5, 1.0, 3.0, 5.0, 6.0, 15.0)  # s; the first two are over before anybody gives it up
KEY, KIND = "rover/imu/data_raw", "Imu"


@dataclass(frozen=True, slots=True)
class Row:
    """What a fault did. `back` is the time from its end to the first fresh sample on the laptop;
    `before` and `during` are what the robot's own listener heard; `zombies` are links that the
    robot still believed in when it was over, beyond the one that is real. `unrecorded` are samples
    that a recorder on the laptop, which asked for what it missed, never got.
    """

    fault: str
    laptop: Heard
    back: Annotated[float | None, "s"]
    before: Heard
    during: Heard
    zombies: int
    unrecorded: int | None = None


class Bench:
    """Ears on both sides of a running pair."""

    def __init__(self, pair: Pair) -> None:
        self.pair = pair
        self.clients: list[Client] = [pair.robot.client(), pair.laptop.client()]
        self.robot = Ear(self.clients[0], KEY, KIND)
        self.laptop = Ear(self.clients[1], KEY, KIND)
        # The laptop watches more than one key, as a page would.
        self.odometry = Ear(self.clients[1], "rover/odom", "Odometry")
        self.await_samples(time.monotonic())

    def await_samples(self, since: float) -> None:
        """Wait until the laptop hears something fresh."""
        end = since + RETURN_S
        while self.laptop.after(since) is None and time.monotonic() < end:
            time.sleep(0.02)

    def row(self, name: str, seconds: float, begin: Callable[[], None], end: Callable[[], None],
            cut: bool = False) -> Row:  # fmt: skip
        """Let a fault act for some seconds; the link is gone meanwhile if it is a `cut`."""
        start = time.monotonic()
        time.sleep(SETTLE_S)
        before = self.robot.between(start, time.monotonic())
        began = time.monotonic()
        begin()
        time.sleep(seconds)
        ended = time.monotonic()
        end()
        restored = time.monotonic()
        back = None
        if cut:
            self.await_samples(restored)
            back = self.laptop.after(restored)
        time.sleep(SETTLE_S)
        over = time.monotonic()
        zombies = max(0, self.pair.robot.sockets() - 1)
        heard = self.laptop.between(began, over if cut else ended)
        return Row(name, heard, back, before, self.robot.between(began, ended), zombies)

    def cable(self, name: str, seconds: float, fault: Fault) -> Row:
        """Spoil the cable for a while."""

        def spoil(now: Fault) -> Callable[[], None]:
            return lambda: setattr(self.pair.cable, "fault", now)

        return self.row(name, seconds, spoil(fault), spoil(Fault()), fault.cut)

    def cut(self, seconds: float) -> Row:
        """Pull the cable for a while, beside a recorder on the laptop."""
        file = self.pair.folder / f"{time.monotonic_ns()}.mcap"
        with self.pair.laptop.recorded(file):
            row = self.cable(f"cut {seconds:g} s", seconds, Fault(cut=True))
        with Recording(file) as recording:
            keys = summarize(recording).keys.values()
        return replace(row, unrecorded=sum(key.lost for key in keys))

    def stopped(self, seconds: float) -> Row:
        """Freeze the laptop's hub."""
        process = self.pair.laptop.process
        return self.row(
            f"laptop stopped {seconds:g} s",
            seconds,
            lambda: process.send_signal(signal.SIGSTOP),
            lambda: process.send_signal(signal.SIGCONT),
            cut=True,
        )

    def half_open(self, seconds: float) -> Row:
        """The laptop dies behind a cut cable, so that nobody tells the robot; then it is back."""
        pair = self.pair

        def vanish() -> None:
            pair.cable.fault = Fault(cut=True)
            time.sleep(0.1)  # nothing of what it says at its end must come through
            os.kill(pair.laptop.process.pid, signal.SIGKILL)
            pair.laptop.process.wait()

        def come_back() -> None:
            pair.cable.fault = Fault()
            pair.laptop.start()
            self.clients[1].close()
            self.clients[1] = pair.laptop.client()
            self.laptop = Ear(self.clients[1], KEY, KIND)

        return self.row("laptop dies unseen", seconds, vanish, come_back, cut=True)

    def slow_reader(self, seconds: float) -> tuple[Heard, Heard]:
        """A reader that needs 50 ms a sample, and one beside it in the same session that is fast:
        what each of them heard.
        """
        slow = Ear(self.clients[1], KEY, KIND, queue=1, work=0.05)
        begin = time.monotonic()
        time.sleep(seconds)
        end = time.monotonic()
        return slow.between(begin, end), self.laptop.between(begin, end)

    def close(self) -> None:
        for client in self.clients:
            client.close()


FAULTS: dict[str, Callable[[Bench], Row]] = {
    **{f"cut{seconds:g}": partial(Bench.cut, seconds=seconds) for seconds in CUTS},
    "loss": lambda bench: bench.cable("5 % loss", 8.0, Fault(delay=0.002, loss=0.05)),
    "jitter": lambda bench: bench.cable("20 +- 15 ms", 8.0, Fault(delay=0.020, jitter=0.015)),
    "both": lambda bench: bench.cable(
        "20 +- 15 ms, 5 % loss", 8.0, Fault(delay=0.020, jitter=0.015, loss=0.05)
    ),
    "slow": lambda bench: bench.cable("256 kbit/s", 8.0, Fault(rate=256e3)),
    "stop": lambda bench: bench.stopped(10.0),
    "half-open": lambda bench: bench.half_open(5.0),
}


def main(argv: list[str]) -> int:
    """Run `lodeline bench link`; the exit code."""
    arguments = parser().parse_args(argv)
    if why := missing():
        print(f"no network namespaces here: {why}", file=sys.stderr)
        return EXIT_FAILED
    sys.setswitchinterval(1e-4)  # the cable and the ears share this process
    with Pair(arguments.tls) as pair:
        bench = Bench(pair)
        wanted = [name for name in arguments.fault or FAULTS for _ in range(arguments.times)]
        rows = [FAULTS[name](bench) for name in wanted]
        slow, fast = bench.slow_reader(5.0)
        bench.close()
    if arguments.json:
        readers = {"slow_reader": asdict(slow), "beside_it": asdict(fast)}
        print(json.dumps({"faults": [asdict(row) for row in rows], **readers}, indent=1))
    else:
        print(shown(rows))
        print(
            f"\nreader of 50 ms a sample: {slow.received} taken, p99 age {_ms(slow.p99)}; "
            f"beside it: {fast.received} taken, {fast.lost} lost, p99 age {_ms(fast.p99)}"
        )
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench link` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench link", description=__doc__)
    known = ", ".join(FAULTS)
    parser.add_argument(
        "fault", nargs="*", type=_fault, metavar="FAULT", help=f"only these, of {known}"
    )
    parser.add_argument("--tls", action="store_true", help="over mutual TLS")
    parser.add_argument("--times", type=int, default=1, help="each so often (default: 1)")
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def _fault(name: str) -> str:
    if name not in FAULTS:
        raise argparse.ArgumentTypeError(f"no fault {name!r}, only {', '.join(FAULTS)}")
    return name


def shown(rows: list[Row]) -> str:
    """The rows for people."""
    headings = (
        *(
            "FAULT",
            "RECEIVED",
            "LOST",
            "NOT RECORDED",
            "AGE P50",
            "P99",
            "OLDEST",
            "BACK AFTER",
            "ZOMBIES",
        ),
        *("ROBOT P99 BEFORE", "DURING", "ROBOT LOST"),
    )
    cells = [
        (
            row.fault,
            *(str(row.laptop.received), str(row.laptop.lost)),
            "-" if row.unrecorded is None else str(row.unrecorded),
            *(_ms(row.laptop.p50), _ms(row.laptop.p99), _ms(row.laptop.oldest)),
            "-" if row.back is None else f"{row.back:.2f} s",
            str(row.zombies),
            *(_ms(row.before.p99), _ms(row.during.p99), str(row.during.lost)),
        )
        for row in rows
    ]
    return table(headings, cells, right=headings[1:])


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.1f} ms"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
