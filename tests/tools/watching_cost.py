"""What watching costs a running pipeline: `python -m tests.tools.watching_cost [SECONDS] [PAIRS]`.

The default pipeline runs; `topic hz -f`, `top` and `logs -f` come and go beside it. CPU time is
the kernel's own account of every thread, in parts of one core.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import mean, stdev
from typing import NamedTuple

from tests.support.live import ROOT, Up, environment, eventually

WATCHERS = (("topic", "hz", "-f"), ("top",), ("logs", "-f"))


class Cost(NamedTuple):
    """CPU of (supervisor, all nodes) in windows without and with watchers, and of the watchers."""

    alone: list[tuple[float, float]]
    watched: list[tuple[float, float]]
    watchers: dict[str, float]

    def difference(self, part: int) -> tuple[float, float]:
        """Mean over the pairs of windows, and its standard error: other programs make noise."""
        steps = [
            after[part] - before[part]
            for before, after in zip(self.alone, self.watched, strict=True)
        ]
        return mean(steps), stdev(steps) / len(steps) ** 0.5


def measure(up: Up, seconds: float, pairs: int) -> Cost:
    """Windows of `seconds` without and with watchers, in turn."""
    nodes = [process["pid"] for process in up.ps().values()]
    pids = ([up.process.pid], nodes)
    alone, watched = [], []
    own = dict.fromkeys((" ".join(words) for words in WATCHERS), 0.0)
    for _ in range(pairs):
        alone.append(_shares(pids, seconds))
        with ExitStack() as stack:
            watchers = {" ".join(words): _start(stack, up, words) for words in WATCHERS}
            before = {name: _cpu([watcher.pid]) for name, watcher in watchers.items()}
            watched.append(_shares(pids, seconds))
            for name, watcher in watchers.items():
                assert watcher.poll() is None, f"{name} ended"
                used = _cpu([watcher.pid]) - before[name]
                own[name] += used / seconds / pairs
    return Cost(alone, watched, own)


def _start(stack: ExitStack, up: Up, words: tuple[str, ...]) -> subprocess.Popen[bytes]:
    """A watcher that has begun to show: what it takes to start is no watching."""
    shown = stack.enter_context(tempfile.NamedTemporaryFile())  # noqa: SIM115
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", *words],
        env=environment(up.run),
        stdout=shown,
    )
    stack.callback(process.wait)
    stack.callback(process.kill)
    assert eventually(lambda: Path(shown.name).stat().st_size > 0, 20.0), words
    return process


def _shares(parts: tuple[list[int], list[int]], seconds: float) -> tuple[float, float]:
    before, begun = [_cpu(pids) for pids in parts], time.monotonic()
    time.sleep(seconds)
    after, elapsed = [_cpu(pids) for pids in parts], time.monotonic() - begun
    return (after[0] - before[0]) / elapsed, (after[1] - before[1]) / elapsed


def _cpu(pids: list[int]) -> float:
    """Seconds that all threads of the processes have run."""
    tasks = [task for pid in pids for task in Path(f"/proc/{pid}/task").iterdir()]
    return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) * 1e-9


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    pairs = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    with Up(ROOT / "pipeline.yaml") as up:
        time.sleep(2.0)
        cost = measure(up, seconds, pairs)
    for part, name in enumerate(("supervisor and hub", "all nodes")):
        before, after = (mean(window[part] for window in windows) for windows in cost[:2])
        change, error = cost.difference(part)
        print(f"{name}: {before:.2%} of a core alone, {after:.2%} watched", end=", ")
        print(f"difference {change:+.2%} with a standard error of {error:.2%}")
    for name, share in cost.watchers.items():
        print(f"lodeline {name}: {share:.2%} of a core itself")


if __name__ == "__main__":
    main()
