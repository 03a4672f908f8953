"""Faults injected into running pipelines: how soon seen, how soon over, what was lost and said.

`detected` is the time to the line on the log or to the node's status, `recovered` the time from the
end of the fault to when the key flows again, `lost` the samples missing on that key by its rate.
With --times each node is killed (-9) so often instead: how soon that is on the log, and how soon
all its keys have samples again. Exit codes: 0 every fault was seen and got over, 1 one was not,
2 usage.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lodeline.bench import kills
from lodeline.bench.rig import Rig
from lodeline.bench.unruly import PIPELINE
from lodeline.supervisor.guard import kill_marked
from lodeline.tables import table
from lodeline_msgs import Imu, Twist, encoding_of, pack

PATIENCE_S = 20.0
PAUSE_S = 2.0
FLOOD_S = 2.0
MESSAGE_WIDTH = 90
COMPLAINTS = ("REFUSED", "LATE")


@dataclass(frozen=True, slots=True)
class Case:
    """One fault: what does it, words of what is said of it ("": nothing), the key that goes on."""

    fault: str
    inject: Callable[[Rig], None]
    words: str
    key: str = "pose"


@dataclass(slots=True)
class Row:
    """What came of it; times [s] are None where it never happened."""

    fault: str
    detected: float | None
    recovered: float | None
    lost: int
    message: str


def main(argv: list[str]) -> int:
    """Run `lodeline bench faults`; the exit code."""
    arguments = parser().parse_args(argv)
    if arguments.times:
        return many_kills(arguments.file, arguments.times)
    with Rig(arguments.file) as rig:
        rig.until(lambda: rig.count("pose") > 200, PATIENCE_S)
        rig.statuses()
        rows = [run(rig, case) for case in CASES]
        rows.append(second_up(rig, arguments.file))
        rows.append(killed_supervisor(rig))
    rows += unruly_nodes()
    headings = ("FAULT", "DETECTED", "RECOVERED", "LOST", "MESSAGE")
    cells = [
        (row.fault, _seconds(row.detected), _seconds(row.recovered), str(row.lost), row.message)
        for row in rows
    ]
    print(table(headings, cells, right=headings[1:4]))
    _print_load()
    return 1 if any(None in (row.detected, row.recovered) for row in rows) else 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench faults` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench faults",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", nargs="?", default="pipeline.yaml", help="the default pipeline")
    parser.add_argument("--times", type=int, default=0, metavar="N", help="kill each node N times")
    return parser


def many_kills(file: str, times: int) -> int:
    """Kill each node so many times; the exit code."""
    with Rig(file) as rig:
        rig.until(lambda: rig.count("pose") > 200, PATIENCE_S)
        found = kills.kill_all(rig, times)
    print(kills.report(found, times))
    _print_load()
    return 0 if kills.all_held(found, times) else 1


def _print_load() -> None:
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


def run(rig: Rig, case: Case) -> Row:
    """Inject one fault and see what follows."""
    key = f"{rig.name}/{case.key}"
    process = rig.processes()
    heard, began = rig.counts.get(key, 0), time.monotonic()
    case.inject(rig)
    over = time.monotonic()
    seen, message = _said(rig, case.words, began) if case.words else (began, "never delivered")
    # A tenth of a second of samples shows that it goes on.
    after = rig.counts.get(key, 0)
    back = rig.until(lambda: rig.counts.get(key, 0) >= after + 10, PATIENCE_S)
    now = time.monotonic()
    rate = _rate(rig, case.key)
    lost = max(0, round((now - began) * rate) - (rig.counts.get(key, 0) - heard))
    well = all(state["state"] != "failed" for state in process.values())
    time.sleep(PAUSE_S)
    return Row(
        case.fault,
        seen - began if message else None,
        max(0.0, now - 10.0 / rate - over) if back and well else None,
        lost,
        (message or "-")[:MESSAGE_WIDTH],
    )


def _said(rig: Rig, words: str, since: float) -> tuple[float, str]:
    """When and in what line of the log or status of a node the words came, within the patience."""
    found: list[tuple[float, str]] = []
    stamp = time.time_ns() - int((time.monotonic() - since) * 1e9)

    def look() -> bool:
        lines = [(when, x) for when, x in list(rig.log) if when >= since and words in x]
        # A status of before tells of the fault before.
        errors = [item.last_error for item in rig.statuses().values() if item.stamp > stamp]
        now = time.monotonic()
        found.extend((when, line.partition("| ")[2]) for when, line in lines)
        found.extend((now, x) for x in errors if words in x and x.startswith(COMPLAINTS))
        return bool(found)

    rig.until(look, PATIENCE_S)
    return found[0] if found else (since, "")


def _rate(rig: Rig, key: str) -> float:
    """Samples a second on a key, as its node counts them when all is well."""
    rates = [status.rates.get(f"{rig.name}/{key}") for status in rig.statuses().values()]
    return max([rate for rate in rates if rate] or [100.0])


def _send_to(node: str, number: int) -> Callable[[Rig], None]:
    def inject(rig: Rig) -> None:
        os.kill(int(rig.processes()[node]["pid"]), number)

    return inject


def _foreign(rig: Rig) -> None:
    publisher = rig.client.publisher(f"{rig.name}/imu/data", encoding_of(Imu))
    rig.until(lambda: publisher.watched, PATIENCE_S)
    for seq in range(200):
        publisher.put(pack(Imu(time.time_ns(), (9.0, 9.0, 9.0), (0.0, 0.0, -9.8), seq=seq)))


def _commands(make: Callable[[int], bytes], count: int) -> Callable[[Rig], None]:
    def inject(rig: Rig) -> None:
        publisher = rig.client.publisher(f"{rig.name}/cmd_vel", encoding_of(Twist))
        rig.until(lambda: publisher.watched, PATIENCE_S)
        for seq in range(count):
            publisher.put(make(seq))

    return inject


def _begin(node: str) -> Callable[[Rig], None]:
    def inject(rig: Rig) -> None:
        publisher = rig.client.publisher(f"{rig.name}/begin_{node}", encoding_of(Twist))
        rig.until(lambda: publisher.watched, PATIENCE_S)
        publisher.put(pack(Twist(time.time_ns(), 0.0, 0.0)))

    return inject


def _flood(rig: Rig) -> None:
    publisher = rig.client.publisher(f"{rig.name}/cmd_vel", encoding_of(Twist))
    rig.until(lambda: publisher.watched, PATIENCE_S)
    end = time.monotonic() + FLOOD_S
    while time.monotonic() < end:
        for _ in range(200):
            publisher.put(b"\xc1")


def _freeze_supervisor(rig: Rig) -> None:
    rig.supervisor.send_signal(signal.SIGSTOP)
    time.sleep(PAUSE_S)
    rig.supervisor.send_signal(signal.SIGCONT)
    os.kill(int(rig.processes()["magnets"]["pid"]), signal.SIGKILL)  # it must still see to it


def second_up(rig: Rig, file: str) -> Row:
    """The same pipeline again: refused, and the first goes on."""
    began, heard = time.monotonic(), rig.count("pose")
    environment = {**os.environ, "LODELINE_RUN": str(rig.running.folder.parents[1])}
    command = [sys.executable, "-P", "-m", "lodeline", "up", file]
    result = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    took = time.monotonic() - began
    refused = result.returncode != 0 and "ALREADY_UP" in result.stderr
    on = rig.until(lambda: rig.count("pose") > heard + 10, PATIENCE_S)
    return Row(
        "a second up", took if refused else None, 0.0 if on else None, 0, result.stderr.strip()
    )


def unruly_nodes() -> list[Row]:
    """Nodes that are silent, leak, or flood the log, in a pipeline of their own."""
    with tempfile.TemporaryDirectory(prefix="llb") as folder:
        file = Path(folder) / "unruly.yaml"
        file.write_text(PIPELINE, encoding="utf-8")
        with Rig(str(file)) as rig:
            # In the first five seconds of its life no rate is judged.
            rig.until(lambda: rig.count("silent") > 600, PATIENCE_S)
            return [run(rig, case) for case in UNRULY]


def killed_supervisor(rig: Rig) -> Row:
    """kill -9 of the supervisor: how soon none of its processes is left."""
    pids = [int(process["pid"]) for process in rig.processes().values()]
    began = time.monotonic()
    rig.supervisor.kill()
    gone = rig.until(lambda: not any(map(_lives, pids)), PATIENCE_S)
    took = time.monotonic() - began
    left = kill_marked(f"NOTIFY_SOCKET={rig.running.folder}/")
    done = took if gone and not left else None
    return Row("supervisor: kill -9", done, done, 0, f"{len(pids)} processes gone")


def _lives(pid: int) -> bool:
    """Whether a process runs; one that is dead and waits to be buried does not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] not in "ZX"


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.2f} s"


def _ahead(seq: int) -> bytes:
    return pack(Twist(time.time_ns() + 3_600_000_000_000, 0.1, 0.0, seq=seq))


def _late(seq: int) -> bytes:
    return pack(Twist(time.time_ns() - 3_500_000_000, 0.1, 0.0, seq=seq))


CASES = (
    Case(
        "attitude: kill -9", _send_to("attitude", signal.SIGKILL), "NODE_EXIT attitude", "attitude"
    ),
    Case("odometry: kill -9", _send_to("odometry", signal.SIGKILL), "NODE_EXIT odometry", "odom"),
    Case("ekf: kill -9", _send_to("ekf", signal.SIGKILL), "NODE_EXIT ekf"),
    Case("ekf: SIGSEGV", _send_to("ekf", signal.SIGSEGV), "NODE_EXIT ekf: SIGSEGV"),
    Case("attitude: SIGSTOP", _send_to("attitude", signal.SIGSTOP), "NODE_SILENT", "attitude"),
    Case("imu: kill -9", _send_to("imu", signal.SIGKILL), "NODE_EXIT imu", "imu/data"),
    Case("simulator: kill -9", _send_to("simulator", signal.SIGKILL), "NODE_EXIT simulator"),
    Case("foreign imu/data", _foreign, "foreign", "attitude"),
    Case("500 broken samples", _commands(lambda _: b"\x81\xa1v\xcb", 500), "truncated"),
    Case("an hour ahead", _commands(_ahead, 20), "ahead of now"),
    Case("a late burst, 3.5 s", _commands(_late, 50), "LATE"),
    Case("10 MB samples", _commands(lambda _: bytes(10_000_000), 3), ""),
    Case("a flood of cmd_vel", _flood, "not msgpack"),
    Case("supervisor frozen 2 s", _freeze_supervisor, "NODE_EXIT magnets"),
)
UNRULY = (
    Case("a node is silent", _begin("silent"), "NO_DATA", "silent"),
    Case("a node leaks, rss_mb 120", _begin("leak"), "RSS leak", "leak"),
    Case("5000 lines a second", _begin("talk"), "lines dropped", "talk"),
)
