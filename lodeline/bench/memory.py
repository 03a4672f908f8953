"""Memory of the default pipeline, a process for each node and all nodes in one.

Nobody else listens: what is sent for a tool is kept for 20 s besides, in case it is cut off.
RSS counts pages that processes share in each of them, PSS in parts, so that sums are true.
Supervisor and guard are counted besides. What only the start needed is let go after 10 s.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from lodeline.bench.family import Memory, family, memory
from lodeline.bench.rig import Rig
from lodeline.loading import shipped
from lodeline.tables import table
from lodeline.terminal.numbers import positive

EXIT_FAILED = 1
MIB = 1 << 20
Held = dict[str, Memory]


def main(argv: list[str]) -> int:
    """Run `lodeline bench memory`; the exit code."""
    arguments = parser().parse_args(argv)
    text = shipped("pipeline.yaml").read_text()
    layouts = {"a process for each node": text, "one process": in_one_process(text)}
    try:
        found = {title: measure(each, arguments.seconds) for title, each in layouts.items()}
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    if arguments.json:
        plain = {
            title: {name: asdict(part) for name, part in held.items()}
            for title, held in found.items()
        }
        print(json.dumps(plain))
    else:
        print("\n\n".join(shown(title, held) for title, held in found.items()))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench memory` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench memory", description=__doc__)
    parser.add_argument(
        "--seconds", type=positive, default=15.0, help="how long each runs before (default: 15)"
    )
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def in_one_process(text: str) -> str:
    """The pipeline file with all its nodes in one process."""
    return text.replace("    run: ", "    process: all\n    run: ")


def measure(text: str, seconds: float) -> Held:
    """Memory of each process of a pipeline, after some seconds; supervisor and guard too."""
    with tempfile.TemporaryDirectory(prefix="llm") as folder:
        file = Path(folder, "pipeline.yaml")
        file.write_text(text)
        with Rig(str(file), deaf=True) as rig:
            time.sleep(seconds)
            pids = {item["pid"]: name for name, item in rig.processes().items()}
            pids[rig.supervisor.pid] = "(supervisor)"
            return {pids.get(pid, "(guard)"): memory(pid) for pid in family([rig.supervisor.pid])}


def shown(title: str, held: Held) -> str:
    """A table with sums."""
    rows = [
        [name, _mib(part.rss), _mib(part.pss), str(part.threads)] for name, part in held.items()
    ]
    nodes = sum(part.pss for name, part in held.items() if not name.startswith("("))
    rows.append(["nodes together", "", _mib(nodes), ""])
    rows.append(["all", "", _mib(sum(part.pss for part in held.values())), ""])
    headings = [title, "RSS MiB", "PSS MiB", "threads"]
    return table(headings, rows, set(headings) - {title})


def _mib(size: int) -> str:
    return f"{size / MIB:.1f}"
