"""How soon a pipeline of eight nodes gives its first pose, and how soon it recovers; idle cost.

`cold` compiles Python's bytecode, `warm` finds it. Lost samples are counted from number 0 of each
key on. A restart is timed from SIGKILL of a stage to the first sample of its successor, here of
processes that have just begun: those that ran for 10 s are started again without a delay of 0.1 s.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Annotated

from lodeline.bench.family import cpu_seconds
from lodeline.run_folder import running
from lodeline.tables import table
from lodeline.terminal.numbers import count, positive
from lodeline.watch import Watch

EXIT_FAILED = 1
PATIENCE_S = 60.0
SETTLE_S = 1.0
STAGES = {"odom": "odometry", "pose": "ekf", "data": "calibrate"}
"""What is killed, by the port of the ear that hears it."""
PIPELINE = """
name: start
nodes:
  simulator: {{run: nodes/simulator.py, outputs: {{truth: truth}}, params: {{rate: 50}}}}
  imu: {{run: nodes/imu.py, outputs: {{data_raw: imu/data_raw, mag_raw: imu/mag_raw}},
        params: {{bus: sim, rate: 200}}}}
  encoders: {{run: nodes/encoders.py, outputs: {{wheels: wheels}},
             params: {{bus: sim, rate: 100}}}}
  calibrate: {{run: nodes/calibrate.py, inputs: {{data_raw: imu/data_raw, mag_raw: imu/mag_raw}},
              outputs: {{data: imu/data, mag: imu/mag}}}}
  attitude: {{run: nodes/attitude.py, inputs: {{data: imu/data, mag: imu/mag}},
             outputs: {{attitude: attitude}}}}
  odometry: {{run: nodes/odometry.py, inputs: {{wheels: wheels}}, outputs: {{odom: odom}},
             params: {{wheel_radius: 0.0215, track: 0.112, ticks_per_turn: 16384}}}}
  ekf: {{run: nodes/ekf.py, inputs: {{odom: odom, attitude: attitude}}, outputs: {{pose: pose}}}}
  ear: {{run: {here}/ear.py, params: {{file: {file}}},
        inputs: {{data: imu/data, wheels: wheels, odom: odom, pose: pose}}}}
"""


@dataclass(frozen=True, slots=True)
class Start:
    """Of one run: from the command to the first pose, and from each kill to the next sample.

    `idle` is what the supervisor takes of a core while nothing happens, `verbs` how long some
    commands took beside the running pipeline.
    """

    first_pose: Annotated[float, "s"]
    lost: int
    restarts: Annotated[list[float], "s"]
    idle: Annotated[float, "1"]
    verbs: Annotated[dict[str, float], "s"]


def main(argv: list[str]) -> int:
    """Run `lodeline bench start`; the exit code."""
    arguments = parser().parse_args(argv)
    with tempfile.TemporaryDirectory(prefix="lls", ignore_cleanup_errors=True) as folder:
        environment = _environment(folder)
        try:
            cold = measure(folder, environment, 0.0)
            runs = [measure(folder, environment, arguments.idle) for _ in range(arguments.rounds)]
        except (RuntimeError, OSError) as error:
            print(error, file=sys.stderr)
            return EXIT_FAILED
    if arguments.json:
        print(json.dumps({"cold": asdict(cold), "warm": [asdict(run) for run in runs]}))
    else:
        print(shown(cold, runs))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench start` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench start", description=__doc__)
    parser.add_argument("--rounds", type=count, default=5, help="warm starts (default: 5)")
    parser.add_argument("--idle", type=positive, default=3.0, help="seconds watched (default: 3)")
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def _environment(folder: str) -> dict[str, str]:
    """Bytecode in a folder of its own: cold at first, warm ever after, whoever runs this."""
    mine = {name: text for name, text in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {
        **mine,
        "PYTHONPYCACHEPREFIX": f"{folder}/bytecode",
        "LODELINE_RUN": f"{folder}/run",
        "NO_COLOR": "1",
    }


def measure(folder: str, environment: dict[str, str], idle: float) -> Start:
    """Start the pipeline once, watch it, kill stages of it, and stop it."""
    file, heard_file = Path(folder, "pipeline.yaml"), Path(folder, "heard.json")
    heard_file.unlink(missing_ok=True)
    here = Path(__file__).parent / "chain" / "nodes"
    file.write_text(PIPELINE.format(here=here, file=heard_file))
    log = Path(folder, "log")
    with log.open("w") as stream:
        began = time.monotonic_ns()
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "lodeline", "up", str(file)],
            env=environment,
            cwd=folder,
            stderr=stream,
        )
    try:
        _wait(lambda: "up in " in log.read_text() or process.poll() is not None)
        time.sleep(SETTLE_S)
        before, since = cpu_seconds(process.pid), time.monotonic()
        time.sleep(idle)
        share = (cpu_seconds(process.pid) - before) / (time.monotonic() - since)
        verbs = {
            words: _timed(words, folder, environment) for words in (f"check {file}", "topic list")
        }
        killed = _kill(environment)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)
    if not heard_file.exists():
        raise RuntimeError(f"it did not run:\n{log.read_text()}")
    heard = {
        port: [(seq, at) for seq, at in samples]
        for port, samples in json.loads(heard_file.read_text()).items()
    }
    return Start(
        first_pose=(heard["pose"][0][1] - began) * 1e-9,
        lost=sum(_lost(samples, min(killed.values())) for samples in heard.values()),
        restarts=[_recovered(heard[port], when) for port, when in killed.items()],
        idle=share,
        verbs={words.split(f" {folder}")[0]: seconds for words, seconds in verbs.items()},
    )


def _wait(what: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not what() and time.monotonic() < end:
        time.sleep(0.02)


def _kill(environment: dict[str, str]) -> dict[str, int]:
    """Kill each stage once; when [monotonic ns], by the ear's port that hears it."""
    (found,) = running(base=Path(environment["LODELINE_RUN"]))
    instants = {}
    with Watch(found) as watch:
        for port, stage in STAGES.items():
            pid = watch.processes()[stage]["pid"]
            instants[port] = time.monotonic_ns()
            os.kill(pid, signal.SIGKILL)
            time.sleep(SETTLE_S)
    return instants


def _lost(samples: list[tuple[int, int]], until: int) -> int:
    """Numbers that are missing from 0 up to the first kill."""
    numbers = [seq for seq, at in samples if at < until]
    return numbers[-1] + 1 - len(numbers) if numbers else 0


def _recovered(samples: Sequence[tuple[int, int]], killed: int) -> float:
    """Seconds until the first sample of the next process, which counts anew."""
    last = max((seq for seq, at in samples if at < killed), default=-1)
    return min(
        ((at - killed) * 1e-9 for seq, at in samples if at > killed and seq <= last),
        default=float("inf"),
    )


def _timed(words: str, folder: str, environment: dict[str, str]) -> float:
    """How long a verb takes [s]."""
    began = time.monotonic()
    subprocess.run(
        [sys.executable, "-P", "-m", "lodeline", *words.split()],
        env=environment,
        cwd=folder,
        capture_output=True,
        check=True,
    )
    return time.monotonic() - began


def shown(cold: Start, runs: list[Start]) -> str:
    """A table: medians and the worst."""
    rows = [
        _row("first pose, cold", [cold.first_pose], "s"),
        _row("first pose, warm", [run.first_pose for run in runs], "s"),
        _row("kill -9 to next sample", [each for run in runs for each in run.restarts], "s"),
        *(
            _row(f"lodeline {name}", [run.verbs[name] for run in runs], "s")
            for name in runs[0].verbs
        ),
        _row("supervisor, idle", [100.0 * run.idle for run in runs], "% of a core"),
        _row("samples lost at the start", [float(run.lost) for run in (cold, *runs)], ""),
    ]
    return table(["what", "median", "worst", "unit"], rows, {"median", "worst"})


def _row(name: str, values: list[float], unit: str) -> list[str]:
    return [name, f"{median(values):.3f}", f"{max(values):.3f}", unit]
