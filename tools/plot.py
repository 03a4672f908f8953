"""Plot a recording: path, heading, speed, attitude, how sure, how honest.

Takes a recording (MCAP) or a folder of tables of `lodeline replay --csv`, and draws every plot that
it has the samples for; of the others it says on standard error why not. Without --png and --html it
lists them. Exit codes: 0 fine, 1 failed, 2 usage, 3 invalid pipeline, 4 nothing there to plot.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.terminal.ending import ended

if TYPE_CHECKING:  # what draws is loaded when there is something to draw
    from lodeline.ekf import LocalizerParams


def main(argv: list[str]) -> int:
    """Run `lodeline plot`; the exit code."""
    args = parser().parse_args(argv)
    return ended(lambda: _plot(args))


def parser() -> argparse.ArgumentParser:
    """What `lodeline plot` takes."""
    made = argparse.ArgumentParser(
        "lodeline plot", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("recording", type=Path, help="MCAP file, or folder of tables")
    made.add_argument("--png", type=Path, metavar="DIR", help="one PNG file for each plot")
    made.add_argument("--html", type=Path, metavar="FILE", help="one page with all of them")
    made.add_argument(
        "--pipeline",
        metavar="FILE",
        help="where gate, magnets and bar are taken from, if the recording does not say",
    )
    made.add_argument("--json", action="store_true", help="print JSON")
    return made


def _plot(args: argparse.Namespace) -> int:
    from lodeline.plotting.draw import draw, say
    from lodeline.plotting.run import Run

    run = Run(args.recording, _params(args.pipeline))
    drawn = draw(run, args.png, args.html)
    if args.json:
        print(json.dumps({"plots": drawn.files, "left_out": drawn.left_out}, indent=1))
        return 0
    for figure in drawn.figures:
        print(f"{figure.kind:12} {figure.title}: {figure.note}")
    if not run.known and "mahalanobis" in drawn.files:
        print("gate, magnets and bar as by default: --pipeline FILE knows better", file=sys.stderr)
    say(drawn, args.png, args.html)
    return 0


def _params(pipeline: str | None) -> LocalizerParams | None:
    if pipeline is None:
        return None
    from lodeline.pipeline.load import find, load
    from lodeline.recording.localizer import params_of

    return params_of(load(find(pipeline)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
