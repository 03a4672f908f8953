"""Look at the keys of a running pipeline: list, echo, hz.

`list` and `hz` read the counters that every node publishes once a second: watching costs the
pipeline nothing. A key may be named without the pipeline's name, or by its end if that is unique.
Exit codes: 0 shown, 1 nothing came in time, 2 usage, 4 nothing runs or no such key.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from typing import Any

from lodeline.tables import table
from lodeline.watch import PATIENCE_S, NothingThereError, Watch, choose
from lodeline_msgs import DecodeError, NodeStatus, class_of, stamp_text, unpack_map

EXIT_FAILED, EXIT_NOTHING = 1, 4
STATUS_PERIOD_S = 1.0


def main(argv: list[str]) -> int:
    """Run `lodeline topic`; the exit code."""
    arguments = _parser().parse_args(argv)
    verb: Callable[[Watch, argparse.Namespace], int] = arguments.run
    try:
        with Watch(choose(arguments.name)) as watch:
            return verb(watch, arguments)
    except NothingThereError as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lodeline topic",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(required=True, metavar="list|echo|hz")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--name", help="which pipeline, if several run")
    common.add_argument("--json", action="store_true", help="JSON on standard output")

    listing = verbs.add_parser("list", parents=[common], help="keys, classes, sources, rates")
    listing.set_defaults(run=_list)

    echo = verbs.add_parser("echo", parents=[common], help="print samples as they come")
    echo.add_argument("key")
    echo.add_argument("-n", "--count", type=_count, help="stop after so many samples")
    echo.add_argument("--timeout", type=float, metavar="S", help="give up after so many seconds")
    echo.set_defaults(run=_echo)

    hz = verbs.add_parser("hz", parents=[common], help="rates, as the sending nodes count them")
    hz.add_argument("keys", nargs="*", metavar="key", help="default: all")
    hz.add_argument("-f", "--follow", action="store_true", help="again every second, until Ctrl-C")
    hz.set_defaults(run=_hz)
    return parser


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise ValueError(text)
    return count


def _list(watch: Watch, arguments: argparse.Namespace) -> int:
    statuses = _statuses(watch)
    name = watch.manifest.name
    rows = [
        (key, known.type, known.node, _rate(statuses, known.node, f"{name}/{key}"))
        for key, known in watch.keys().items()
    ]
    if arguments.json:
        fields = ("key", "class", "node", "rate")
        print(json.dumps([dict(zip(fields, row, strict=True)) for row in rows], indent=1))
    else:
        cells = [(key, cls, node or "(outside)", _hz_text(rate)) for key, cls, node, rate in rows]
        print(table(("KEY", "CLASS", "FROM", "HZ"), cells, right=("HZ",)))
    return 0


def _hz(watch: Watch, arguments: argparse.Namespace) -> int:
    keys = [watch.full_key(name) for name in arguments.keys] or list(watch.manifest.keys)
    while True:
        statuses = _statuses(watch)
        rows = [_traffic(watch, statuses, key) for key in keys]
        if arguments.json:
            print(json.dumps(rows), flush=True)
        else:
            print(_hz_table(rows), flush=True)
        if not arguments.follow:
            return 0
        time.sleep(STATUS_PERIOD_S)
        print()


def _traffic(watch: Watch, statuses: dict[str, NodeStatus], key: str) -> dict[str, Any]:
    """Rate of a key by its sender, and what became of its samples at each receiver."""
    known = watch.manifest.keys[key]
    return {
        "key": key.removeprefix(f"{watch.manifest.name}/"),
        "node": known.node,
        "rate": _rate(statuses, known.node, key),
        "to": {
            status.node: {
                "age_p50": status.age_p50.get(key),
                "age_p99": status.age_p99.get(key),
                "lost": status.lost[key],
                "late": status.late[key],
            }
            for status in statuses.values()
            if key in status.received
        },
    }


def _hz_table(rows: list[dict[str, Any]]) -> str:
    cells = []
    for row in rows:
        readers = row["to"] or {"": {"age_p50": None, "age_p99": None, "lost": "", "late": ""}}
        for place, (node, seen) in enumerate(readers.items()):
            first = place == 0
            cells.append(
                (
                    row["key"] if first else "",
                    _hz_text(row["rate"]) if first else "",
                    node,
                    _ms_text(seen["age_p50"]),
                    _ms_text(seen["age_p99"]),
                    str(seen["lost"]),
                    str(seen["late"]),
                )
            )
    numbers = ("HZ", "AGE P50", "P99", "LOST", "LATE")
    return table(("KEY", "HZ", "READ BY", *numbers[1:]), cells, right=numbers)


def _echo(watch: Watch, arguments: argparse.Namespace) -> int:
    left: int | None = arguments.count

    def show(data: bytes, encoding: str) -> bool:
        nonlocal left
        try:
            print(_sample_text(data, encoding, arguments.json), flush=True)
        except DecodeError as error:
            print(error, file=sys.stderr)
        if left is not None:
            left -= 1
        return left is None or left > 0

    key = watch.full_key(arguments.key)
    return 0 if watch.follow(key, show, arguments.timeout) else EXIT_FAILED


def _sample_text(data: bytes, encoding: str, as_json: bool) -> str:
    """A sample as one line of JSON, or as lines of `field: value unit`."""
    values = unpack_map(data)
    if as_json:
        return json.dumps(values)
    units = {spec.name: spec.unit.unit for spec in _specs(encoding)}
    lines = [
        f"{name}: {_value_text(name, value)} {units.get(name, '')}"
        for name, value in values.items()
    ]
    return "\n".join([*(line.rstrip() for line in lines), "---"])


def _specs(encoding: str) -> Any:
    from lodeline_msgs import field_specs

    try:
        return field_specs(class_of(encoding))
    except DecodeError:
        return ()


def _value_text(name: str, value: Any) -> str:
    if name == "stamp" and isinstance(value, int):
        return f"{value} ({stamp_text(value)} s)"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return f"[{', '.join(_value_text('', part) for part in value)}]"
    return str(value)


def _statuses(watch: Watch) -> dict[str, NodeStatus]:
    """Statuses of all nodes; says so when some do not tell."""
    statuses = watch.statuses(PATIENCE_S)
    silent = [node for node in watch.manifest.nodes if node not in statuses]
    if silent:
        print(f"no status from {', '.join(silent)}", file=sys.stderr, flush=True)
    return statuses


def _rate(statuses: dict[str, NodeStatus], node: str | None, key: str) -> float | None:
    status = statuses.get(node or "")
    return None if status is None else status.rates.get(key)


def _hz_text(rate: float | None) -> str:
    return "-" if rate is None else f"{rate:.1f}"


def _ms_text(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.2f} ms"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
