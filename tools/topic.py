"""Look at the keys of a running pipeline: list, info, echo, hz, bw, delay; send on them: pub.

All but echo and pub read the counters that every node publishes once a second: watching costs
it next to nothing. A key may be named without the pipeline's name, or by its end if that is unique.
Exit codes: 0 shown, 1 nothing came in time, 2 usage, 4 nothing runs or no such key.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.tables import table
from lodeline.terminal.ending import ended
from lodeline.terminal.numbers import count, positive
from lodeline.terminal.parser import VerbParser
from lodeline.terminal.samples import make_message, read_values, sample_text
from lodeline.terminal.traffic import (
    Row,
    bw_table,
    delay_table,
    hz_table,
    milliseconds,
    number,
    traffic,
)
from lodeline.watch import PATIENCE_S, NothingThereError, Watch, choose, meant_key
from lodeline_msgs import MESSAGES, DecodeError, FieldSpec, encoding_of, field_specs, pack

if TYPE_CHECKING:  # the bus is loaded by `lodeline.watch`
    from lodeline.bus import Publisher

EXIT_FAILED, EXIT_USAGE, EXIT_NOTHING = 1, 2, 4
STATUS_PERIOD_S = 1.0
TABLES: dict[str, Callable[[list[Row]], str]] = {
    "hz": hz_table,
    "bw": bw_table,
    "delay": delay_table,
}


def main(argv: list[str]) -> int:
    """Run `lodeline topic`; the exit code."""
    arguments = parser().parse_args(argv)
    try:
        if getattr(arguments, "bag", None) is not None:
            return ended(lambda: _echo_bag(arguments))
        with Watch(choose(arguments.name)) as watch:
            verb: Callable[[Watch, argparse.Namespace], int] = arguments.run
            return verb(watch, arguments)
    except NothingThereError as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING


def parser() -> argparse.ArgumentParser:
    """What `lodeline topic` takes."""
    parser = VerbParser(
        prog="lodeline topic",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    common = VerbParser(add_help=False)
    common.add_argument("--name", metavar="PIPELINE", help="which pipeline, if several run")
    common.add_argument("--json", action="store_true", help="JSON on standard output")

    listing = verbs.add_parser("list", parents=[common], help="keys, classes, sources, rates")
    listing.set_defaults(run=_list)

    info = verbs.add_parser(
        "info", parents=[common], help="all that is known of a key: fields, source, readers"
    )
    info.add_argument("key")
    info.set_defaults(run=_info)

    echo = verbs.add_parser("echo", parents=[common], help="print samples as they come")
    echo.add_argument("key")
    echo.add_argument("-n", "--count", type=count, help="stop after so many samples")
    echo.add_argument("--timeout", type=positive, metavar="S", help="give up after S seconds")
    echo.add_argument("--bag", type=Path, metavar="FILE", help="samples of a recording instead")
    echo.set_defaults(run=_echo)

    for name, caption in (
        ("hz", "rates, as the sending nodes count them, and losses"),
        ("bw", "bandwidths, as the sending nodes count them"),
        ("delay", "ages of samples on arrival, as the reading nodes measure them"),
    ):
        verb = verbs.add_parser(name, parents=[common], help=caption)
        verb.add_argument("keys", nargs="*", metavar="key", help="default: all")
        verb.add_argument(
            "-f", "--follow", action="store_true", help="again every second, until Ctrl-C"
        )
        verb.set_defaults(run=_traffic, table=TABLES[name])

    pub = verbs.add_parser(
        "pub", parents=[common], help="send on a key that the pipeline takes from outside"
    )
    pub.add_argument("key")
    pub.add_argument(
        "values", nargs="+", help="field=value, or a map: '{v: 0.1, w: 0}'; stamp and seq are made"
    )
    pub.add_argument("--rate", type=positive, metavar="HZ", help="again and again, until Ctrl-C")
    pub.add_argument("-n", "--count", type=count, help="stop after so many (default: 1, or all)")
    pub.set_defaults(run=_pub)
    return parser


def _list(watch: Watch, arguments: argparse.Namespace) -> int:
    statuses = watch.statuses(PATIENCE_S)
    rows = [traffic(watch.manifest, statuses, key) for key in watch.manifest.keys]
    classes = {key: known.type for key, known in watch.keys().items()}
    if arguments.json:
        fields = [
            {
                "key": row["key"],
                "class": classes[row["key"]],
                "node": row["node"],
                "rate": row["rate"],
            }
            for row in rows
        ]
        print(json.dumps(fields, indent=1))
    else:
        cells = [
            (row["key"], classes[row["key"]], row["node"] or "(outside)", number(row["rate"]))
            for row in rows
        ]
        print(table(("KEY", "CLASS", "FROM", "HZ"), cells, right=("HZ",)))
    return 0


def _info(watch: Watch, arguments: argparse.Namespace) -> int:
    full = watch.full_key(arguments.key)
    short = full.removeprefix(f"{watch.manifest.name}/")
    known = watch.all_keys()[short]
    if full in watch.manifest.keys:
        row = traffic(watch.manifest, watch.statuses(PATIENCE_S), full)
    else:  # what a node says of itself is for tools alone
        row = {"key": short, "node": known.node, "rate": None, "bandwidth": None, "to": {}}
    specs = _fields(watch, known.type)
    policies = {item.node: item for item in watch.manifest.readers.get(full, ())}
    for node, seen in row["to"].items():
        seen |= {"queue": policies[node].queue, "max_age": policies[node].max_age}
    if arguments.json:
        fields = [
            {"name": spec.name, "unit": spec.unit.unit, "meaning": spec.unit.meaning}
            for spec in specs
        ]
        print(json.dumps({**row, "class": known.type, "fields": fields}, indent=1))
        return 0
    rate = "" if row["rate"] is None else f", {row['rate']:.1f} Hz"
    print(f"{full}: {known.type} from {known.node or 'outside'}{rate}\n")
    cells = [(spec.name, spec.unit.unit or "-", spec.unit.meaning) for spec in specs]
    print(table(("FIELD", "UNIT", "MEANING"), cells))
    print(f"\n{_readers_table(row)}" if row["to"] else "\nno node reads it")
    return 0


def _fields(watch: Watch, name: str) -> Sequence[FieldSpec]:
    """Fields of a message class; one that is in a node's own file is known once that is loaded."""
    if name not in MESSAGES:
        from lodeline.pipeline.load import load_unchanged

        manifest = watch.manifest
        load_unchanged(manifest.file, manifest.digest, manifest.overrides)
    return field_specs(MESSAGES[name]) if name in MESSAGES else ()


def _readers_table(row: Row) -> str:
    headings = ("READ BY", "QUEUE", "MAX AGE", "RECEIVED", "LOST", "LATE", "AGE P50", "P99")
    cells = [
        (
            node,
            "newest" if seen["queue"] == 1 else f"newest {seen['queue']}",
            "any" if seen["max_age"] is None else f"{seen['max_age']:g} s",
            *("-" if seen[name] is None else str(seen[name]) for name in _COUNTERS),
            milliseconds(seen["age_p50"]),
            milliseconds(seen["age_p99"]),
        )
        for node, seen in row["to"].items()
    ]
    return table(headings, cells, right=headings[3:])


_COUNTERS = ("received", "lost", "late")


def _traffic(watch: Watch, arguments: argparse.Namespace) -> int:
    # What a node says of itself is a key too, but nobody counts it.
    keys = [watch.full_key(name, watch.keys()) for name in arguments.keys]
    keys = keys or list(watch.manifest.keys)
    patience = PATIENCE_S
    for _ in watch.ticks(STATUS_PERIOD_S):
        statuses = watch.statuses(patience)
        patience = 0.0
        bars = watch.clock_bars()
        rows = [traffic(watch.manifest, statuses, key, bars) for key in keys]
        text = json.dumps(rows) if arguments.json else arguments.table(rows)
        print(text, end="\n" if arguments.json or not arguments.follow else "\n\n", flush=True)
        if not arguments.follow:
            break
    return 0


def _echo(watch: Watch, arguments: argparse.Namespace) -> int:
    left: int | None = arguments.count
    key = watch.full_key(arguments.key)
    specs = _fields(watch, watch.all_keys()[key.removeprefix(f"{watch.manifest.name}/")].type)

    def show(data: bytes, _encoding: str) -> bool:
        nonlocal left
        _print_sample(data, specs, arguments.json)
        if left is not None:
            left -= 1
        return left is None or left > 0

    return 0 if watch.follow(key, show, arguments.timeout) else EXIT_FAILED


def _echo_bag(arguments: argparse.Namespace) -> int:
    from lodeline.recording.read import Recording

    with Recording(arguments.bag) as recording:
        types = {key: info.type for key, info in recording.channels.items() if info.type}
        key = meant_key(arguments.key, types, str(arguments.bag))
        for place, packed in enumerate(recording.packed([key]), 1):
            _print_sample(packed.data, field_specs(types[key]), arguments.json)
            if place == arguments.count:
                break
    return 0


def _print_sample(data: bytes, specs: Sequence[FieldSpec], as_json: bool) -> None:
    try:
        print(sample_text(data, specs, as_json), flush=True)
    except DecodeError as error:
        print(error, file=sys.stderr)


def _pub(watch: Watch, arguments: argparse.Namespace) -> int:
    key = watch.full_key(arguments.key)
    short = key.removeprefix(f"{watch.manifest.name}/")
    known = watch.all_keys()[short]
    if known.node is not None:
        outside = [name for name, other in watch.keys().items() if other.node is None]
        print(
            f"{short} comes from node {known.node}: two sources on one key cannot be told apart "
            f"(from outside: {', '.join(outside) or 'none'})",
            file=sys.stderr,
        )
        return EXIT_USAGE
    if why := watch.manifest.unheard(key):
        print(why, file=sys.stderr)
        return EXIT_FAILED
    cls = MESSAGES[known.type]
    try:
        values = read_values(arguments.values)
        make_message(cls, values, time.time_ns(), 0)
    except ValueError as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    if watch.manifest.clock == "recording" and "stamp" not in values:
        print(
            f"{watch.manifest.name} takes its time from a recording: give a stamp of it too",
            file=sys.stderr,
        )
        return EXIT_USAGE
    publisher = watch.publisher(key, encoding_of(cls))
    _await_reader(watch, publisher)
    most = arguments.count or (None if arguments.rate else 1)
    for seq, _ in enumerate(watch.ticks(1.0 / (arguments.rate or 10.0))):
        message = make_message(cls, values, time.time_ns(), seq)
        publisher.put(pack(message))
        if arguments.json:
            print(sample_text(pack(message), (), True), flush=True)
        if seq + 1 == most:
            break
    return 0


def _await_reader(watch: Watch, publisher: Publisher) -> None:
    """Wait until somebody listens; say so if that takes long, and end if the pipeline does."""
    changed = threading.Event()
    publisher.on_watched = changed.set
    for turn, _ in enumerate(watch.ticks(0.0)):
        if publisher.watched or changed.wait(PATIENCE_S):
            return
        if turn == 0:
            print(f"waiting for a reader of {publisher.key}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
