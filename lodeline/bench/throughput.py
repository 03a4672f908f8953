"""How much goes through: the largest IMU rate without a loss, replay speed, record rate.

The chain is that of `lodeline bench latency`; a rate counts if no sample was lost on the way to
the pose in `--seconds`, and all were sent. Replay is the default pipeline, EKF included, over a
recording of its own simulator, on one core. Recording is from a running pipeline to a file.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Annotated

from lodeline.bench.chain import runs
from lodeline.bench.chain.runs import Start
from lodeline.bench.up import Up
from lodeline.loading import shipped
from lodeline.pipeline.load import load
from lodeline.recording.offline import Replay
from lodeline.recording.read import Recording
from lodeline.tables import table
from lodeline.terminal.numbers import count, positive

EXIT_FAILED = 1
LADDER = (500, 1000, 1500, 2000, 2500, 3000, 4000, 5000, 6000, 8000, 10000, 12000)
"""Rates [Hz] that are tried."""
ALL_SENT = 0.98
AT_LEAST = 0.8
"""Of a rate, what a source must reach for a higher one to be worth a try."""
PROBE_S = 1.0
RECORD_S = 3.0
CHAINS: dict[str, Start] = {
    "(a) process per node": runs.apart,
    "(b) estimation grouped": runs.grouped,
    "(c) all in one": runs.together,
}
RECORDED = """
name: recorded
nodes:
  source: {{run: {here}/source.py, outputs: {{data_raw: imu/data_raw}},
           params: {{rate: {rate}, folder: "{{folder}}"}}}}
"""


@dataclass(frozen=True, slots=True)
class Throughput:
    """What was found; `replay` is a multiple of real time, `replayed` the length of the recording.

    A rate of 0 says that none of those tried went through whole.
    """

    chain: Annotated[dict[str, int], "Hz"]
    record: Annotated[int, "samples/s"]
    replay: float
    replayed: Annotated[float, "s"]


def main(argv: list[str]) -> int:
    """Run `lodeline bench throughput`; the exit code."""
    arguments = parser().parse_args(argv)
    ladder = [rate for rate in LADDER if rate <= arguments.most]
    try:
        replay, replayed = replay_speed(arguments.recording)
        found = Throughput(
            {name: largest(start, ladder, arguments.seconds) for name, start in CHAINS.items()},
            recorded(ladder, min(RECORD_S, arguments.seconds)),
            replay,
            replayed,
        )
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    print(json.dumps(asdict(found)) if arguments.json else shown(found, arguments.seconds))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench throughput` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench throughput", description=__doc__)
    parser.add_argument("--seconds", type=positive, default=10.0, help="without loss (default: 10)")
    parser.add_argument("--most", type=count, default=LADDER[-1], help="highest rate tried [Hz]")
    parser.add_argument(
        "--recording", type=positive, default=20.0, help="seconds recorded to replay (default: 20)"
    )
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def largest(start: Start, ladder: list[int], seconds: float) -> int:
    """The largest rate [Hz] of a ladder at which the chain lost nothing; 0 for none."""
    best = -1
    while best + 1 < len(ladder) and _whole(start, ladder[best + 1], min(PROBE_S, seconds)):
        best += 1
    while best >= 0 and seconds > PROBE_S and not _whole(start, ladder[best], seconds):
        best -= 1
    return ladder[best] if best >= 0 else 0


def _whole(start: Start, rate: int, seconds: float) -> bool:
    cost = runs.measure(start, rate, seconds)
    return cost.lost == 0 and cost.samples >= ALL_SENT * rate * seconds


def recorded(ladder: list[int], seconds: float) -> int:
    """The largest rate [samples/s] that `lodeline bag record` took down whole; 0 for none.

    It is that of the samples in the file: a source may skip ticks, which no recorder can help.
    """
    best = 0
    for rate in ladder:
        text = RECORDED.format(here=runs.HERE / "nodes", rate=rate)
        with Up(text) as up:
            said = _record(up, ["--seconds", f"{seconds:g}"])
            with Recording(up.folder / "OUT.mcap") as recording:
                first, last = recording.span
        samples = re.search(r": (\d+) samples", said)
        if samples is None or last <= first or "nothing lost" not in said:
            break
        reached = round((int(samples[1]) - 1) / ((last - first) * 1e-9))
        best = max(best, reached)
        if reached < AT_LEAST * rate:
            break  # the source gives no more
    return best


def _record(up: Up, words: list[str]) -> str:
    """What `lodeline bag record` says at its end. The file is OUT.mcap in the folder of `up`."""
    command = [sys.executable, "-P", "-m", "lodeline", "bag", "record", "-o"]
    done = subprocess.run(
        [*command, str(up.folder / "OUT.mcap"), *words],
        env=up.environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"bag record: {done.stderr}")
    return done.stdout


def replay_speed(seconds: float) -> tuple[float, float]:
    """Seconds of a recording replayed in one second of one core, and its length [s]."""
    file = shipped("pipeline.yaml")
    with Up(file.read_text()) as up, tempfile.TemporaryDirectory(prefix="llr") as folder:
        _record(up, ["--seconds", f"{seconds:g}"])
        up.stop()  # from now on the machine is the replay's alone
        times, span = [], 0.0
        for _ in range(3):
            replay = Replay(load(file))
            began = time.thread_time()
            with Recording(up.folder / "OUT.mcap") as recording:
                first, last = recording.span
                span = (last - first) * 1e-9
                replay.run(recording, Path(folder))
            times.append(time.thread_time() - began)
    return span / median(times), span


def shown(found: Throughput, seconds: float) -> str:
    """A table."""
    rows = [
        *(
            [f"IMU rate without a loss for {seconds:g} s, {name}", f"{rate}", "Hz"]
            for name, rate in found.chain.items()
        ),
        ["recorded without a loss", f"{found.record}", "samples/s"],
        ["replay, 200 Hz IMU, EKF, one core", f"{found.replay:.0f}", "x real time"],
    ]
    return table(["what", "most", "unit"], rows, {"most"})
