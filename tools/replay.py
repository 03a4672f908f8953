"""Run a recording through a pipeline, offline: same recording, same bytes out.

The pipeline's drivers stay out; every key that its other nodes send is computed anew.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # MCAP and YAML are loaded when the arguments are known to be good
    from lodeline.pipeline.model import Pipeline
    from lodeline.recording.offline import Outcome


def main(argv: list[str]) -> int:
    """Exit 0 fine, 1 the recording cannot be used or a node failed, 3 invalid pipeline."""
    args = parser().parse_args(argv)
    from lodeline.pipeline.load import PipelineError, find, load
    from lodeline.recording import RecordingError

    try:
        pipeline = load(find(args.pipeline), args.set)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 3
    try:
        outcome = _replay(pipeline, args)
    except (RecordingError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
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
    parser.add_argument("recording", type=Path, help="MCAP file")
    parser.add_argument(
        "--pipeline", required=True, metavar="FILE", help="pipeline file, or a profile's name"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAM=VALUE",
        help="another value for a parameter",
    )
    parser.add_argument("--csv", type=Path, metavar="DIR", help="one table for each key")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="recording of it all")
    parser.add_argument("--force", action="store_true", help="replace the output if it exists")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _replay(pipeline: Pipeline, args: argparse.Namespace) -> Outcome:
    from lodeline.recording.localizer import noted
    from lodeline.recording.offline import Listener, Replay
    from lodeline.recording.read import Recording
    from lodeline.recording.table import Tables
    from lodeline.recording.write import RecordingWriter, whole_file

    replay = Replay(pipeline)
    listeners: list[Listener] = []
    with ExitStack() as stack:
        recording = stack.enter_context(Recording(args.recording))
        replay.check(recording)
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        writer = None
        if args.output is not None:
            stream = stack.enter_context(whole_file(args.output, replace=args.force))
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
