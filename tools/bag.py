"""Recordings: import, look into, play back, export, recover.

`lodeline bag VERB --help` tells more of each.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.recording import RecordingError

if TYPE_CHECKING:  # MCAP and zenoh are loaded by the verbs that need them
    from lodeline.recording.play import Choice
    from lodeline.recording.read import Recording
    from lodeline.run_folder import Running

MATCH_S = 3.0


def main(argv: list[str]) -> int:
    """Exit 0 fine, 1 failed, 3 recovered with losses, 4 no pipeline runs."""
    args = _arguments(argv)
    try:
        done: int = args.verb(args)
    except (RecordingError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return done


def _arguments(argv: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser("lodeline bag", description=__doc__)
    verbs = parser.add_subparsers(required=True, metavar="VERB")

    verb = verbs.add_parser("import", help="make a recording of a robot's text file")
    verb.add_argument("file", type=Path)
    verb.add_argument("--format", required=True, choices=["magnet-lab"], help="what the file is")
    verb.add_argument(
        "--course",
        action="store_true",
        help="as the lab's course takes it: rows at rest dropped, 5 Hz, 45 counts a turn",
    )
    _output(verb)
    verb.set_defaults(verb=_import)

    verb = verbs.add_parser("info", help="keys, counts, rates, duration")
    verb.add_argument("file", type=Path)
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.set_defaults(verb=_info)

    verb = verbs.add_parser("play", help="send a recording to a running pipeline")
    verb.add_argument("file", type=Path)
    verb.add_argument("--rate", type=_positive, default=1.0, help="times as fast as recorded")
    verb.add_argument("--name", metavar="PIPELINE", help="which one, if several run")
    verb.set_defaults(verb=_play)

    verb = verbs.add_parser("export", help="one CSV table for each key")
    verb.add_argument("file", type=Path)
    verb.add_argument("--csv", type=Path, required=True, metavar="DIR")
    verb.set_defaults(verb=_export)

    verb = verbs.add_parser("recover", help="save what is whole of a damaged recording")
    verb.add_argument("file", type=Path)
    _output(verb)
    verb.set_defaults(verb=_recover)
    return parser.parse_args(argv)


def _output(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.mcap")
    verb.add_argument("--force", action="store_true", help="replace the output if it exists")


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is no rate above 0")
    return value


def _import(args: argparse.Namespace) -> int:
    from lodeline.recording import magnet_lab
    from lodeline.recording.write import RecordingWriter, whole_file

    rows = magnet_lab.read_rows(args.file)
    if args.course:
        try:
            rows = magnet_lab.course_setting(rows)
        except ValueError as error:
            raise RecordingError(f"{args.file}: {error}") from None
    setting = "course setting" if args.course else "all rows"
    metadata = {"clock": "recording", "source": f"magnet-lab text {args.file.name}, {setting}"}
    with whole_file(args.output, replace=args.force) as stream:
        writer = RecordingWriter(stream, metadata)
        for key, message in magnet_lab.messages(rows):
            writer.write(key, message)
        writer.close()
    seconds = (rows[-1].stamp - rows[0].stamp) * 1e-9
    print(f"{args.output}: {len(rows)} rows of wheels and reeds, {seconds:.2f} s")
    return 0


def _info(args: argparse.Namespace) -> int:
    from lodeline.recording.read import Recording
    from lodeline.recording.summary import summarize

    with Recording(args.file) as recording:
        summary = summarize(recording)
    print(json.dumps(summary.as_json(), indent=1) if args.json else summary.as_text())
    return 0


def _export(args: argparse.Namespace) -> int:
    from lodeline.recording.read import Recording
    from lodeline.recording.table import Tables

    with Recording(args.file) as recording:
        types = [(key, info.type) for key, info in recording.channels.items() if info.type]
        with Tables(args.csv, types) as tables:
            for key, message, _ in recording.samples():
                tables.write(key, message)
    return 0


def _recover(args: argparse.Namespace) -> int:
    from lodeline.recording.recover import recover

    found = recover(args.file, args.output, replace=args.force)
    print(f"{args.output}: {found.messages} messages")
    for text in [*found.damaged, *filter(None, [found.end])]:
        print(f"{args.file}: {text}", file=sys.stderr)
    return 0 if found.complete else 3


def _play(args: argparse.Namespace) -> int:
    from lodeline.recording.play import choose
    from lodeline.recording.read import Recording
    from lodeline.watch import NothingThereError
    from lodeline.watch import choose as choose_pipeline

    with Recording(args.file) as recording:
        try:
            target = choose_pipeline(args.name)
        except NothingThereError as error:
            print(error, file=sys.stderr)
            return 4
        keys = target.keys()
        choice = choose(
            recording,
            {key: known.type for key, known in keys.items() if known.node is None},
            {key: known.node for key, known in keys.items() if known.node is not None},
        )
        return _send(recording, choice, target, args.rate)


def _refuse_second(target: Running, keys: Mapping[str, object]) -> None:
    """A pipeline whose time comes from recordings cannot go back to the start of another one."""
    from lodeline.watch import Watch

    with Watch(target) as watch:
        full = [f"{target.manifest.name}/{key}" for key in keys]
        for status in watch.statuses(MATCH_S).values():
            if any(status.received.get(key) for key in full):
                raise RecordingError(
                    f"{target.manifest.name} has played a recording already and stands at its end: "
                    "start it again with `lodeline up`"
                )


def _send(recording: Recording, choice: Choice, target: Running, rate: float) -> int:
    from lodeline.bus import BusError, Client, wait_watched
    from lodeline.recording.play import play
    from lodeline_msgs import encoding_of

    keeps_stamps = target.manifest.clock == "recording"
    if not keeps_stamps and rate != 1.0:
        raise RecordingError(
            f"--rate {rate:g} needs a pipeline with `clock: recording`: {target.manifest.name} "
            "measures ages by the host's time"
        )
    _say_left_out(choice.left_out)
    if keeps_stamps:
        _refuse_second(target, choice.types)
    try:
        client = Client(target.folder)
    except BusError as error:
        raise RecordingError(f"{target.manifest.name} cannot be reached: {error}") from None
    try:
        publishers = {
            key: client.publisher(f"{target.manifest.name}/{key}", encoding_of(cls))
            for key, cls in choice.types.items()
        }
        if waiting := wait_watched(list(publishers.values()), MATCH_S):
            raise RecordingError(f"no node listens to {', '.join(waiting)}: nothing played")
        played = play(
            recording.packed(choice.types),
            choice.types,
            lambda key, data: publishers[key].put(data),
            rate=rate,
            start=None if keeps_stamps else time.time_ns(),
        )
    finally:
        client.close()
    print(
        f"{played.samples} samples of {', '.join(choice.types)} played, "
        f"at most {played.latest * 1e3:.1f} ms late"
    )
    return 0


def _say_left_out(left_out: Mapping[str, str]) -> None:
    for key, node in left_out.items():
        print(f"{key} is not played: node {node} of the pipeline sends it", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
