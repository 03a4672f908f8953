"""Recordings: record, import, look into, play back, export, recover.

`lodeline bag VERB --help` tells more of each. Ctrl-C is the regular end of `record`: the file is
closed, exit 0. Exit codes: 0 fine, 1 failed (for `record`: the disk is full), 2 usage,
3 recovered with losses, 4 no such file or key, or no pipeline runs, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.recording import NoRecordingError, RecordingError, texts
from lodeline.terminal.numbers import positive, seconds
from lodeline.terminal.parser import VerbParser
from lodeline.watch import NothingThereError

if TYPE_CHECKING:  # MCAP is loaded by the verbs that need it
    from lodeline.recording.record import Recorder
    from lodeline.recording.texts import Imported


def main(argv: list[str]) -> int:
    """Run `lodeline bag`; the exit code."""
    args = parser().parse_args(argv)
    try:
        done: int = args.verb(args)
    except BrokenPipeError:
        raise
    except (NothingThereError, NoRecordingError) as error:
        print(error, file=sys.stderr)
        return 4
    except (RecordingError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return done


def parser() -> argparse.ArgumentParser:
    """What `lodeline bag` takes."""
    parser = VerbParser(
        "lodeline bag", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(required=True, metavar="VERB")

    verb = verbs.add_parser("record", help="write down what a running pipeline sends, until Ctrl-C")
    verb.add_argument("keys", nargs="*", metavar="KEY", help="default: all")
    _output(verb, "PIPELINE-DATE-TIME.mcap")
    verb.add_argument("--seconds", type=positive, metavar="N", help="end after N seconds")
    verb.add_argument("--name", metavar="PIPELINE", help="which one, if several run")
    verb.set_defaults(verb=_record)

    verb = verbs.add_parser("import", help="make a recording of a robot's text file")
    verb.add_argument("file", type=Path)
    verb.add_argument(
        "--format", choices=list(FORMATS), default="csv", help="what the file is (default: csv)"
    )
    verb.add_argument(
        "--map", type=Path, metavar="MAP.yaml", help="csv: which column is which field of which key"
    )
    verb.add_argument(
        "--preview",
        action="store_true",
        help="csv: show columns, first rows and a map to begin with; with --map, what it makes",
    )
    texts.add_options(verb)
    _output(verb, "FILE.mcap, here")
    verb.set_defaults(verb=_import)

    verb = verbs.add_parser("info", help="keys, counts, rates, duration")
    verb.add_argument("file", type=Path)
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.set_defaults(verb=_info)

    verb = verbs.add_parser("play", help="send a recording to a running pipeline")
    verb.add_argument("file", type=Path)
    verb.add_argument("--rate", type=positive, default=1.0, help="times as fast as recorded")
    verb.add_argument("--start", type=seconds, default=0.0, metavar="S", help="from here on")
    verb.add_argument("--loop", action="store_true", help="again and again, until Ctrl-C")
    verb.add_argument("--keys", nargs="+", default=[], metavar="KEY", help="these keys only")
    verb.add_argument("--name", metavar="PIPELINE", help="which one, if several run")
    verb.set_defaults(verb=_play)

    verb = verbs.add_parser("export", help="one CSV table for each key")
    verb.add_argument("file", type=Path)
    verb.add_argument("--csv", type=Path, required=True, metavar="DIR", help="folder for them")
    verb.set_defaults(verb=_export)

    verb = verbs.add_parser("recover", help="save what is whole of a damaged recording")
    verb.add_argument("file", type=Path)
    _output(verb)
    verb.set_defaults(verb=_recover)
    return parser


def _output(verb: argparse.ArgumentParser, default: str = "") -> None:
    text = f"the new recording (default: {default})" if default else "the new recording"
    verb.add_argument(
        "-o", "--output", type=Path, required=not default, metavar="OUT.mcap", help=text
    )
    verb.add_argument("--force", action="store_true", help="replace the output if it exists")


def _import(args: argparse.Namespace) -> int:
    from lodeline.recording.write import whole_file

    if args.format == "csv" and (args.preview or args.map is None):
        return _preview(args)
    imported = FORMATS[args.format](args.file, args)
    samples = imported[0]
    if not samples:
        raise RecordingError(f"{args.file}: no row makes a sample (look with --preview)")
    output = args.output or Path(f"{args.file.name.partition('.')[0]}.mcap")
    with whole_file(output, replace=args.force, source=args.file) as stream:
        texts.write(imported, stream)
    seconds = (samples[-1][1].stamp - samples[0][1].stamp) * 1e-9
    rows = sum(key == samples[0][0] for key, _ in samples)
    keys = " and ".join(dict.fromkeys(key for key, _ in reversed(samples)))
    print(f"{output}: {rows} rows of {keys}, {seconds:.2f} s")
    return 0


def _preview(args: argparse.Namespace) -> int:
    from lodeline.recording import csv_preview
    from lodeline.recording.csv_guess import propose
    from lodeline.recording.csv_map import read_map
    from lodeline.recording.csv_table import CsvTable

    with CsvTable(args.file) as table:
        if args.map is not None:
            print("\n".join(csv_preview.of_map(table, read_map(args.map, table.columns))))
            return 0
        if args.preview:
            first = csv_preview.first_rows(table)
            print("\n".join(csv_preview.of_columns(table, first)), file=sys.stderr)
            print(propose(table.columns, first[0] if first else ()), end="")
            return 0
    raise RecordingError(
        f"{args.file}: which column is what? Begin with\n"
        f"  lodeline bag import {args.file} --preview > map.yaml\n"
        f"correct map.yaml, and import with --map map.yaml"
    )


def _csv(file: Path, args: argparse.Namespace) -> Imported:
    from lodeline.recording.csv_map import read_map, samples
    from lodeline.recording.csv_table import CsvTable

    with CsvTable(file) as table:
        mapping = read_map(args.map, table.columns)
        return list(samples(table, mapping)), f"{file.name} by {args.map.name}"


FORMATS: dict[str, Callable[[Path, argparse.Namespace], Imported]] = {"csv": _csv, **texts.FORMATS}


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
            rows = 0
            for key, message, _ in recording.samples():
                tables.write(key, message)
                rows += 1
        for key, info in recording.channels.items():
            if not info.type:
                what = f"the schema of its class {info.type_name or 'without a name'}"
                text = f"{args.file}: {key} is left out: {what} says nothing that a table holds"
                print(text, file=sys.stderr)
    print(f"{args.csv}: {len(types)} tables, {rows} rows")
    return 0


def _recover(args: argparse.Namespace) -> int:
    from lodeline.recording.recover import recover

    found = recover(args.file, args.output, replace=args.force)
    print(f"{args.output}: {found.messages} messages")
    for text in [*found.damaged, *filter(None, [found.end])]:
        print(f"{args.file}: {text}", file=sys.stderr)
    return 0 if found.complete else 3


def _record(args: argparse.Namespace) -> int:
    from lodeline.pipeline.load import load_unchanged
    from lodeline.recording.live import FULL, interrupts, record_live
    from lodeline.recording.localizer import noted
    from lodeline.recording.record import Recorder, default_name
    from lodeline.watch import Watch, choose

    with Watch(choose(args.name)) as watch, interrupts() as interrupted:
        manifest = watch.manifest
        prefix = f"{manifest.name}/"
        chosen = {watch.full_key(name).removeprefix(prefix) for name in args.keys}
        keys = {key: known.type for key, known in watch.all_keys().items()}
        recorder = Recorder(
            args.output or Path(default_name(manifest.name, time.localtime())),
            manifest.name,
            {key: cls for key, cls in keys.items() if not chosen or key in chosen},
            {
                "pipeline": manifest.name,
                "digest": manifest.digest,
                "clock": manifest.clock,
                "source": f"live on {manifest.host}",
                **noted(load_unchanged(manifest.file, manifest.digest, manifest.overrides)),
            },
            replace=args.force,
            ask=watch.ask_behind,
        )
        end = record_live(watch, recorder, args.seconds, interrupted, _progress(recorder))
        return _say_recorded(recorder, end, failed=end == FULL)


def _progress(recorder: Recorder) -> Callable[[float], None]:
    def show(elapsed: float) -> None:
        if sys.stderr.isatty():
            text = f"{elapsed:.0f} s, {recorder.samples} samples, {_size(recorder)}"
            lost = recorder.lost_text()
            sys.stderr.write(f"\r{text}{', lost ' if lost else ''}{lost}  (Ctrl-C ends)\x1b[K")
            sys.stderr.flush()

    return show


def _say_recorded(recorder: Recorder, end: str, failed: bool) -> int:
    if sys.stderr.isatty():
        sys.stderr.write("\r\x1b[K")
    lost = recorder.lost_text()
    text = f"{recorder.sink.path}: {recorder.samples} samples, {_size(recorder)}, {end}"
    count = recorder.filled.total()
    filled = f" ({count} on the way, had from their senders)" if count else ""
    print(f"{text}, {'lost ' + lost if lost else 'nothing lost'}{filled}")
    if recorder.samples == 0:
        print("no sample came: does anybody send? (`lodeline topic hz`)", file=sys.stderr)
    for key, why in recorder.refused.items():
        print(f"REFUSED {key}: {why}", file=sys.stderr)
    if recorder.sink.pending:
        print(
            f"DISK_ERROR {recorder.sink.error}: the recording could not be closed; save what is "
            f"whole by `lodeline bag recover {recorder.sink.path} -o NEW.mcap`",
            file=sys.stderr,
        )
    elif failed:
        now = time.strftime("%H:%M:%S")
        spared = f": of the disk {recorder.room.spared}" if recorder.room.gone else ""
        text = f"DISK_FULL recording stopped at {now}, file closed and readable{spared}"
        print(text, file=sys.stderr)
    return 1 if failed or recorder.sink.pending else 0


def _size(recorder: Recorder) -> str:
    return f"{recorder.sink.written / 1e6:.1f} MB"


def _play(args: argparse.Namespace) -> int:
    from lodeline.recording.live_play import send
    from lodeline.recording.play import choose
    from lodeline.recording.read import Recording
    from lodeline.watch import choose as choose_pipeline
    from lodeline.watch import meant_key

    with Recording(args.file) as recording:
        target = choose_pipeline(args.name)
        keys = target.keys()
        choice = choose(
            recording,
            {key: known.type for key, known in keys.items() if known.node is None},
            {key: known.node for key, known in keys.items() if known.node is not None},
            [meant_key(name, recording.channels, str(args.file)) for name in args.keys],
        )
        _say_left_out(choice.left_out)
        played = send(recording, choice, target, rate=args.rate, begin=args.start, loop=args.loop)
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
