"""Runs one chain in one way for some seconds: how old the poses were, and what that took."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Annotated

from lodeline.bench.chain.ends import FLOWS, HEARD, SENT
from lodeline.bench.family import cpu_seconds, family, memory
from lodeline.loading import shipped

STAGES = 7
"""Source, calibrate, attitude, wheels, odometry, ekf, subscriber."""
START_S, STOP_S, WARM_S = 30.0, 10.0, 0.7
HERE = Path(__file__).parent
ONE_THREAD = (
    "(rx: (handover: app), acc: (handover: app), tx: (handover: app), net: (handover: app))"
)
PIPELINE = """
name: chain
nodes:
  source: {{run: {here}/source.py, outputs: {{data_raw: imu/data_raw}}, {one}
           params: {{rate: {rate}, folder: {folder}}}}}
  calibrate: {{run: {nodes}/calibrate.py, {estimation} inputs: {{data_raw: imu/data_raw}},
              outputs: {{data: imu/data, mag: imu/mag}}}}
  attitude: {{run: {nodes}/attitude.py, {estimation} inputs: {{data: imu/data}},
             outputs: {{attitude: attitude}}}}
  wheels: {{run: {here}/wheels.py, {estimation} inputs: {{attitude: attitude}},
           outputs: {{wheels: wheels}}}}
  odometry: {{run: {nodes}/odometry.py, {estimation} inputs: {{wheels: wheels}},
             outputs: {{odom: odom}},
             params: {{wheel_radius: 0.0215, track: 0.112, ticks_per_turn: 16384}}}}
  ekf: {{run: {nodes}/ekf.py, {estimation} inputs: {{odom: odom}}, outputs: {{pose: pose}}}}
  sink: {{run: {here}/sink.py, inputs: {{pose: pose}}, params: {{folder: {folder}}}}}
"""


@dataclass(frozen=True, slots=True)
class Cost:
    """What came of a run. `cpu` is of all its processes, supervisors included; `rss` is the
    median of a stage, `pss` the sum of all, `calls` the time of the computation alone, if known.
    """

    samples: int
    lost: int
    p50: Annotated[float, "us"]
    p99: Annotated[float, "us"]
    p999: Annotated[float, "us"]
    cpu: Annotated[float, "s per 1000 samples"]
    processes: int
    threads: Annotated[float, "median of a process"]
    rss: Annotated[int, "B"]
    pss: Annotated[int, "B"]
    calls: Annotated[float, "us"] = float("nan")


Start = Callable[[str, float], list[list[str]]]
"""Commands that make up a chain which writes into a folder and runs at a rate [Hz]."""


def raw(folder: str, rate: float, tuned: bool = False) -> list[list[str]]:
    """Zenoh alone, one process a stage, the subscriber first."""
    return [_stage("raw", folder, rate, i, STAGES - 1, tuned) for i in reversed(range(STAGES))]


def raw_tuned(folder: str, rate: float) -> list[list[str]]:
    """The same with the settings that our bus takes."""
    return [["env", f"ZENOH_RUNTIME={ONE_THREAD}", *line] for line in raw(folder, rate, True)]


def calls(folder: str, rate: float) -> list[list[str]]:
    """All computed by plain calls, and one hop."""
    return [_stage("calls", folder, rate, i, 1) for i in (1, 0)]


def apart(folder: str, rate: float) -> list[list[str]]:
    """Ours, one process per node."""
    return _ours(folder, rate)


def grouped(folder: str, rate: float) -> list[list[str]]:
    """Ours, the nodes that estimate in one process."""
    return _ours(folder, rate, estimation="process: estimation,")


def together(folder: str, rate: float) -> list[list[str]]:
    """Ours, all nodes in one process."""
    return _ours(folder, rate, "process: all,", "process: all,")


def dora(folder: str, rate: float) -> list[list[str]]:
    """dora-rs, one process a stage, started by `dora run`."""
    lines = ["nodes:"]
    for i in range(STAGES):
        words = _stage("dora_stage", folder, rate, i, STAGES - 1)
        lines += [f"  - id: n{i}", f"    path: {words[0]}", f"    args: {' '.join(words[1:])}"]
        if i:
            lines += ["    inputs:", "      in:", f"        source: n{i - 1}/out"]
            lines += ["        queue_size: 256"]
        if i < STAGES - 1:
            lines += ["    outputs:", "      - out"]
    Path(folder, "flow.yml").write_text("\n".join([*lines, ""]))
    return [[str(dora_command()), "run", f"{folder}/flow.yml"]]


def dora_command() -> str | None:
    """The dora program beside this Python, if dora-rs is installed too."""
    found = shutil.which("dora", path=str(Path(sys.executable).parent))
    return found if found and find_spec("dora") else None


def _stage(
    program: str, folder: str, rate: float, stage: int, last: int, tuned: bool = False
) -> list[str]:
    words = [sys.executable, "-P", str(HERE / f"{program}.py"), "--folder", folder]
    words += ["--stage", str(stage), "--last", str(last), "--rate", f"{rate:g}"]
    return [*words, "--tuned"] if tuned else words


def _ours(folder: str, rate: float, one: str = "", estimation: str = "") -> list[list[str]]:
    file = Path(folder, "pipeline.yaml")
    file.write_text(
        PIPELINE.format(
            here=HERE / "nodes",
            nodes=shipped("nodes"),
            rate=rate,
            folder=folder,
            one=one,
            estimation=estimation,
        )
    )
    return [[sys.executable, "-P", "-m", "lodeline", "up", str(file)]]


def measure(start: Start, rate: float, seconds: float) -> Cost:
    """Start a chain, let it warm up, watch it for some seconds, stop it.

    RuntimeError with its last words if nothing comes through it.
    """
    with tempfile.TemporaryDirectory(prefix="llc", ignore_cleanup_errors=True) as folder:
        environment = {**os.environ, "LODELINE_RUN": f"{folder}/run", "NO_COLOR": "1"}
        with Path(folder, "log").open("w") as log:
            processes = [
                subprocess.Popen(
                    command,
                    env=environment,
                    cwd=folder,
                    stdout=log,
                    stderr=log,
                    process_group=0,
                )
                for command in start(folder, rate)
            ]
        try:
            if not _until(Path(folder, FLOWS).exists, START_S):
                raise RuntimeError(f"nothing came through:\n{Path(folder, 'log').read_text()}")
            time.sleep(WARM_S)
            pids = family(process.pid for process in processes)
            begin, used = time.monotonic_ns(), sum(map(cpu_seconds, pids))
            time.sleep(seconds)
            end, used = time.monotonic_ns(), sum(map(cpu_seconds, pids)) - used
            held = [memory(pid) for pid in pids]
        finally:
            _stop(processes)
        if not _until(Path(folder, HEARD).exists, STOP_S):
            raise RuntimeError(f"the end kept no record:\n{Path(folder, 'log').read_text()}")
        sent, done = json.loads(Path(folder, SENT).read_text())
        heard = json.loads(Path(folder, HEARD).read_text())
    ages = sorted(age * 1e-3 for _, age, at in heard if begin <= at < end)
    stamps = {stamp for stamp, _, at in heard if begin <= at < end}
    if not stamps:
        raise RuntimeError("nothing came while it was measured")
    due = {stamp for stamp in sent if min(stamps) <= stamp <= max(stamps)}
    return Cost(
        samples=len(ages),
        lost=len(due - stamps),
        p50=quantile(ages, 0.5),
        p99=quantile(ages, 0.99),
        p999=quantile(ages, 0.999),
        cpu=used / len(ages) * 1000.0,
        processes=len(held),
        threads=median(one.threads for one in held),
        rss=round(median(one.rss for one in held)),
        pss=sum(one.pss for one in held),
        calls=median(done) * 1e-3 if done else float("nan"),
    )


def quantile(values: list[float], part: float) -> float:
    """Of sorted values, the one below which that part of them lies."""
    return values[min(len(values) - 1, int(part * len(values)))]


def _until(what: Callable[[], bool], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def _stop(processes: list[subprocess.Popen[bytes]]) -> None:
    """As Ctrl-C in a terminal does; what is still there after a while is killed."""
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
    end = time.monotonic() + STOP_S
    for process in processes:
        try:
            process.wait(max(0.1, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
