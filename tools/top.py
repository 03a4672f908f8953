"""Watch the nodes of a running pipeline: state, rates, ages, losses, cost, last error.

Shown anew every second until Ctrl-C. The figures are those that every node publishes about
itself: watching costs it next to nothing. Ages are the oldest of a node's inputs, since the
sensor was read; losses are counts since the node started, of a driver also the ticks that it
missed (LOST) and was late for (LATE). Exit codes: 0 shown, 2 usage, 4 nothing runs (any more),
130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
import time

from lodeline.terminal.health import Row, health, health_table
from lodeline.terminal.screen import Screen
from lodeline.watch import PATIENCE_S, NothingThereError, Watch, choose

EXIT_NOTHING = 4
PERIOD_S = 1.0


def main(argv: list[str]) -> int:
    """Run `lodeline top`; the exit code."""
    arguments = parser().parse_args(argv)
    try:
        with Watch(choose(arguments.name)) as watch:
            watch.statuses(PATIENCE_S)
            if arguments.json or arguments.once:
                _print(watch, arguments)
            else:
                _refresh(watch)
    except NothingThereError as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline top` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline top",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--name", metavar="PIPELINE", help="which one, if several run")
    parser.add_argument("--once", action="store_true", help="show it once")
    parser.add_argument(
        "--json", action="store_true", help="one JSON list a second on standard output"
    )
    return parser


def _print(watch: Watch, arguments: argparse.Namespace) -> None:
    for _ in watch.ticks(PERIOD_S):
        rows, _cpu = _look(watch)
        print(json.dumps(rows) if arguments.json else health_table(rows), flush=True)
        if arguments.once:
            return


def _refresh(watch: Watch) -> None:
    with Screen() as screen:
        for _ in watch.ticks(PERIOD_S):
            rows, cpu = _look(watch)
            up = time.time() - watch.manifest.started
            head = f"{watch.manifest.name} on {watch.manifest.host}, up {up:.0f} s"
            screen.show(f"{head}, {cpu:.1%} of a core\n\n{health_table(rows)}")


def _look(watch: Watch) -> tuple[list[Row], float]:
    """A row of each node, and what all their processes together use of one core."""
    processes = watch.processes()
    rows = health(watch.manifest, watch.statuses(0.0), watch.silence(), processes)
    cpus = {process["process"]: process["cpu"] or 0.0 for process in processes.values()}
    return rows, sum(cpus.values())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
