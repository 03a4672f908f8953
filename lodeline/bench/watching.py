"""What watching costs a running pipeline, in parts of one core: terminal tools, then the page.

Windows without and with watchers take turns, so that other programs hit both alike. CPU time is
the kernel's own account of every thread. Exit codes: 0 the terminal tools cost less than a
hundredth of a core, all of them together, and what they cost the pipeline cannot be told from less,
1 more, 2 usage.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import mean, stdev
from typing import NamedTuple
from urllib.parse import urlsplit

from lodeline.bench.rig import Rig
from lodeline.tables import table
from lodeline.terminal.numbers import count, positive

WATCHERS = (("topic", "hz", "-f"), ("topic", "delay", "-f"), ("top",), ("logs", "-f"))
PAGE = (("dash",),)
MOST = 0.01
START_S = 20.0
SETTLE_S = 2.0


class Cost(NamedTuple):
    """CPU of the pipeline in windows without and with watchers, and of each watcher itself."""

    alone: list[float]
    watched: list[float]
    watchers: dict[str, float]

    @property
    def difference(self) -> tuple[float, float]:
        """Mean over the pairs of windows, and its standard error."""
        steps = [after - before for before, after in zip(self.alone, self.watched, strict=True)]
        return mean(steps), stdev(steps) / len(steps) ** 0.5 if len(steps) > 1 else 0.0


def main(argv: list[str]) -> int:
    """Run `lodeline bench watching`; the exit code."""
    arguments = parser().parse_args(argv)
    with Rig(arguments.file, deaf=True) as rig:
        time.sleep(SETTLE_S)
        kinds = {"terminal": WATCHERS, "page": PAGE}
        costs = {
            name: measure(rig, commands, arguments.seconds, arguments.pairs)
            for name, commands in kinds.items()
        }
    rows = []
    for name, cost in costs.items():
        change, error = cost.difference
        each = [f"{words} {own:.2%}" for words, own in cost.watchers.items()]
        rows.append(
            (
                f"{name}: {', '.join(each)}",
                f"{mean(cost.alone):.2%}",
                f"{mean(cost.watched):.2%}",
                f"{change:+.2%}",
                f"{error:.2%}",
                f"{sum(cost.watchers.values()):.2%}",
            )
        )
    headings = ("WATCHED BY", "ALONE", "WATCHED", "COST", "+-", "WATCHERS THEMSELVES")
    print(table(headings, rows, right=headings[1:]))
    change, error = costs["terminal"].difference
    own = sum(costs["terminal"].watchers.values())
    return 0 if own < MOST and change - 2.0 * error < MOST else 1


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench watching` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench watching",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", nargs="?", default="pipeline.yaml", help="a pipeline")
    parser.add_argument("--seconds", type=positive, default=5.0, help="length of a window")
    parser.add_argument("--pairs", type=count, default=5, help="of windows, without and with")
    return parser


def measure(rig: Rig, commands: tuple[tuple[str, ...], ...], seconds: float, pairs: int) -> Cost:
    """Windows of `seconds` without and with watchers, in turn."""
    pids = [rig.supervisor.pid, *(process["pid"] for process in rig.processes().values())]
    alone, watched = [], []
    own = dict.fromkeys((" ".join(words) for words in commands), 0.0)
    for _ in range(pairs):
        alone.append(_share(pids, seconds))
        with ExitStack() as stack:
            watchers = {" ".join(words): _start(stack, rig, words) for words in commands}
            before = {name: _cpu([watcher.pid]) for name, watcher in watchers.items()}
            watched.append(_share(pids, seconds))
            for name, watcher in watchers.items():
                if watcher.poll() is not None:
                    raise RuntimeError(f"lodeline {name} ended")
                own[name] += (_cpu([watcher.pid]) - before[name]) / seconds / pairs
    return Cost(alone, watched, own)


def _start(stack: ExitStack, rig: Rig, words: tuple[str, ...]) -> subprocess.Popen[bytes]:
    """A watcher that has begun to show: what it takes to start is no watching."""
    shown = stack.enter_context(tempfile.NamedTemporaryFile())  # noqa: SIM115
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", *words],
        env=rig.environment,
        stdout=shown,
        stderr=subprocess.DEVNULL,
    )
    stack.callback(process.wait)
    stack.callback(process.kill)
    file = Path(shown.name)
    if not rig.until(lambda: file.stat().st_size > 0, START_S):
        raise RuntimeError(f"lodeline {' '.join(words)} shows nothing")
    if words in PAGE:
        _look(stack, file.read_text().strip())
    return process


def _look(stack: ExitStack, url: str) -> None:
    """Be a browser that reads all that it gets."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect
    from websockets.typing import Origin

    place = urlsplit(url).netloc
    socket = connect(f"ws://{place}/ws", origin=Origin(f"http://{place}"), compression=None)
    socket.send(json.dumps({"do": "hello", "token": ""}))

    def read() -> None:
        try:
            for text in socket:
                said = json.loads(text)
                if said["t"] == "frame":
                    socket.send(json.dumps({"ack": said["n"]}))
        except ConnectionClosed:
            return

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    stack.callback(socket.close)


def _share(pids: list[int], seconds: float) -> float:
    before, begun = _cpu(pids), time.monotonic()
    time.sleep(seconds)
    return (_cpu(pids) - before) / (time.monotonic() - begun)


def _cpu(pids: list[int]) -> float:
    """Seconds that all threads of the processes have run."""
    tasks = [task for pid in pids for task in Path(f"/proc/{pid}/task").iterdir()]
    return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) * 1e-9
