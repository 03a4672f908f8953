"""Show what the nodes of a running pipeline printed: the newest lines, and new ones with -f.

With a NODE it is what this node printed, and what the supervisor says of it; `lodeline` is the
supervisor itself. Lines of several hosts are put in order of time. Of a pipeline that has ended
it is the newest log file of each node: ~/.local/state/lodeline/PIPELINE/HOST/NODE.log, of which
five of 5 MB are kept. Exit codes: 0 shown, or the pipeline that was followed has ended, 2 usage,
4 nothing runs and nothing is kept, or no such node, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

from lodeline.params import nearest
from lodeline.run_folder import log_folder, running
from lodeline.supervisor.log_files import read
from lodeline.terminal.log_lines import OURS, Line, Lines, is_about, line_text
from lodeline.terminal.numbers import whole
from lodeline.terminal.screen import colours
from lodeline.watch import LOOK_S, NothingThereError, Watch, choose

EXIT_NOTHING = 4
GATHER_S = 0.2


def main(argv: list[str]) -> int:
    """Run `lodeline logs`; the exit code."""
    arguments = parser().parse_args(argv)
    try:
        with Watch(choose(arguments.name)) as watch:
            return _show(watch, arguments)
    except NothingThereError as error:
        folder = None if arguments.follow or running() else _last_run(arguments.name)
        if folder is None:
            print(error, file=sys.stderr)
            return EXIT_NOTHING
        return _show_files(folder, arguments)


def parser() -> argparse.ArgumentParser:
    """What `lodeline logs` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline logs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("nodes", nargs="*", metavar="NODE", help="of these nodes only")
    parser.add_argument("-f", "--follow", action="store_true", help="new lines too, until Ctrl-C")
    parser.add_argument(
        "-n", "--lines", type=whole, metavar="LINES", help="only the newest so many of the old"
    )
    parser.add_argument("--name", metavar="PIPELINE", help="which one, if several run")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    return parser


def _show(watch: Watch, arguments: argparse.Namespace) -> int:
    wanted = {_process(watch, node) for node in arguments.nodes}
    names = [OURS, *dict.fromkeys(watch.manifest.nodes.values())]
    lines = Lines(watch)
    if arguments.follow:
        lines.follow()
    old = _newest([line for line in lines.kept() if is_about(line, wanted)], arguments.lines)
    coloured = colours()
    for line in old:
        print(json.dumps(line) if arguments.json else line_text(line, names, coloured))
    sys.stdout.flush()
    try:
        for _ in watch.ticks(LOOK_S, lines.came) if arguments.follow else ():
            if lines.came.is_set():
                time.sleep(GATHER_S)  # other hosts and nodes speak of the same event: in order
            for line in lines.new():
                if is_about(line, wanted):
                    text = json.dumps(line) if arguments.json else line_text(line, names, coloured)
                    print(text, flush=True)
    except NothingThereError as error:
        print(error, file=sys.stderr)
    return 0


def _last_run(name: str | None) -> Path | None:
    """The log folder of the pipeline (the one of that name) that printed last."""
    files = log_folder().glob(f"{name or '*'}/*/{OURS}.log")
    newest = max(files, key=lambda file: file.stat().st_mtime, default=None)
    return None if newest is None else newest.parent


def _show_files(folder: Path, arguments: argparse.Namespace) -> int:
    print(f"{folder.parent.name} does not run; from {folder}", file=sys.stderr)
    lines = list(read(folder))
    names = [OURS, *sorted({line["name"] for line in lines} - {OURS})]
    for node in arguments.nodes:
        if not any(is_about(line, {node}) for line in lines):
            print(f"nothing about {node!r} there{nearest(node, names)}", file=sys.stderr)
            return EXIT_NOTHING
    about = [line for line in lines if is_about(line, set(arguments.nodes))]
    for line in _newest(about, arguments.lines):
        text = line_text(line, names, colours())
        print(json.dumps(line | {"host": folder.name}) if arguments.json else text)
    return 0


def _newest(lines: list[Line], count: int | None) -> list[Line]:
    return lines if count is None else lines[len(lines) - min(count, len(lines)) :]


def _process(watch: Watch, node: str) -> str:
    """The process that prints for a node: nodes that share one cannot be told apart."""
    processes = watch.manifest.nodes
    if node in (OURS, *processes.values()):
        return node
    if node not in processes:
        raise NothingThereError(
            f"no node {node!r} in {watch.manifest.name}{nearest(node, [*processes, OURS])}"
        )
    return processes[node]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
