"""Run a recording through a pipeline, offline: same recording, same bytes out.

The pipeline's drivers stay out; every key that its other nodes send is computed anew. A robot's
text file (--format) is imported on the way, and --png or --html draw the plots: one command from
the file to what is handed in.

Exit codes: 0 fine, 1 the recording cannot be used or a node failed, 2 usage, 3 invalid pipeline,
4 no such file, or nothing in it to plot.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.recording import texts
from lodeline.terminal.ending import ended

if TYPE_CHECKING:  # MCAP and YAML are loaded when the arguments are known to be good
    from lodeline.pipeline.model import Pipeline
    from lodeline.recording.offline import Outcome


def main(argv: list[str]) -> int:
    """Run `lodeline replay`; the exit code."""
    made = parser()
    args = made.parse_args(argv)
    if not (args.pipeline or args.format):
        made.error("--pipeline is needed: which nodes shall take the recording?")
    from lodeline.pipeline.load import PipelineError, find, load

    try:
        pipeline = load(find(args.pipeline or args.format), args.set)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 3
    return ended(lambda: _told(_replay(pipeline, args), args))


def _told(outcome: Outcome, args: argparse.Namespace) -> int:
    """Say what came of it; the exit code."""
    print(json.dumps(_as_json(outcome), indent=1) if args.json else _as_text(outcome))
    for text, times in outcome.said.items():
        print(f"{text}{f' ({times} times)' if times > 1 else ''}", file=sys.stderr)
    for fault in outcome.faults:
        print(fault, file=sys.stderr)
    for name, count in outcome.failed.items():
        print(f"{name} could not take {count} samples", file=sys.stderr)
    return 1 if outcome.failed else 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline replay` takes."""
    parser = argparse.ArgumentParser("lodeline replay", description=__doc__)
    parser.add_argument("recording", type=Path, help="MCAP file, or a text file of --format")
    parser.add_argument(
        "--pipeline",
        metavar="FILE",
        help="pipeline file, or a profile's name (default: the profile of --format)",
    )
    parser.add_argument(
        "--format", choices=list(texts.FORMATS), help="import this kind of text file on the way"
    )
    texts.add_options(parser)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAM=VALUE",
        help="another value for a parameter",
    )
    parser.add_argument("--csv", type=Path, metavar="DIR", help="one table for each key")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="recording of it all")
    parser.add_argument("--png", type=Path, metavar="DIR", help="plots of it, one file each")
    parser.add_argument("--html", type=Path, metavar="FILE", help="one page with all plots of it")
    parser.add_argument("--force", action="store_true", help="replace the output if it exists")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _replay(pipeline: Pipeline, args: argparse.Namespace) -> Outcome:
    """Import, replay and plots, as far as they are asked for."""
    from lodeline.recording.write import whole_file

    plotted = args.png is not None or args.html is not None
    with tempfile.TemporaryDirectory() as scratch:
        source, output = args.recording, args.output
        if args.format is not None:
            imported = texts.FORMATS[args.format](source, args)
            source = Path(scratch) / f"{source.stem}.mcap"
            with whole_file(source) as stream:
                texts.write(imported, stream)
        if output is None and plotted:  # under its own name, for the titles
            folder = Path(scratch) / "replayed"
            folder.mkdir()
            output = folder / f"{source.stem}.mcap"
        outcome = _run(pipeline, source, output, args)
        if plotted:
            from lodeline.plotting.draw import draw, say
            from lodeline.plotting.run import Run

            say(draw(Run(output), args.png, args.html), args.png, args.html)
    return outcome


def _run(
    pipeline: Pipeline, source: Path, output: Path | None, args: argparse.Namespace
) -> Outcome:
    from lodeline.recording.localizer import noted
    from lodeline.recording.offline import Listener, Replay
    from lodeline.recording.read import Recording
    from lodeline.recording.table import Tables
    from lodeline.recording.write import RecordingWriter, whole_file

    replay = Replay(pipeline)
    listeners: list[Listener] = []
    with ExitStack() as stack:
        recording = stack.enter_context(Recording(source))
        replay.check(recording)
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        writer = None
        if output is not None:
            stream = stack.enter_context(
                whole_file(output, replace=args.force, source=args.recording)
            )
            writer = RecordingWriter(
                stream,
                {
                    "pipeline": pipeline.name,
                    "digest": pipeline.digest,
                    "clock": "recording",
                    "source": f"replay of {args.recording.name}",
                    **noted(pipeline),
                },
            )
            listeners.append(writer.write)
        if args.csv is not None:
            types = replay.inputs | replay.outputs | replay.told(recording)
            tables = stack.enter_context(Tables(args.csv, types.items()))
            listeners.append(lambda key, message, _: tables.write(key, message))
        outcome = replay.run(recording, scratch, listeners)
        if writer is not None:
            writer.close()
    return outcome


def _as_json(outcome: Outcome) -> dict[str, object]:
    return {
        "hash": outcome.digest,
        "keys": {
            key: {"samples": traffic.samples, "rate": traffic.rate, "source": traffic.source}
            for key, traffic in outcome.traffic.items()
        },
        "failed": outcome.failed,
    }


def _as_text(outcome: Outcome) -> str:
    width = max(map(len, ["key", *outcome.traffic]))
    lines = [f"{'key':{width}}  {'samples':>8}  {'Hz':>8}  from"]
    lines += [
        f"{key:{width}}  {traffic.samples:8}  {traffic.rate:8.2f}  {traffic.source or 'recording'}"
        for key, traffic in outcome.traffic.items()
    ]
    return "\n".join([*lines, f"hash: {outcome.digest}"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
