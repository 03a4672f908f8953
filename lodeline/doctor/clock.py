"""How far the clocks of the hosts of a running pipeline are apart, with an error bar."""

from __future__ import annotations

import argparse
import json
import sys
import time

from lodeline.hosts.offset import Offset, better, measured
from lodeline.tables import table
from lodeline.watch import NothingThereError, Watch, choose

EXIT_FAILED, EXIT_NOTHING = 1, 4
QUESTIONS = 20
LARGE_S = 0.1
VAGUE_S = 0.05


def main(argv: list[str]) -> int:
    """Run `lodeline doctor clock`; the exit code: 0 measured, 1 a host is silent, 4 none runs."""
    arguments = parser().parse_args(argv)
    try:
        with Watch(choose(arguments.name)) as watch:
            found = _measure(watch)
            wanted = set(watch.manifest.places.values()) | set(watch.manifest.hosts)
    except NothingThereError as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING
    answered = {part for host in found for part in host.split("+")}
    silent = sorted(wanted - answered)
    if arguments.json:
        print(json.dumps({"hosts": found, "silent": silent}, indent=1))
    else:
        print(_shown(found))
        for host in silent:
            print(f"{host}: no answer: is it up, and linked? see `lodeline doctor net`")
    return EXIT_FAILED if silent else 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline doctor clock` takes."""
    parser = argparse.ArgumentParser(prog="lodeline doctor clock", description=__doc__)
    parser.add_argument("--name", metavar="PIPELINE", help="which pipeline, if several run")
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def _measure(watch: Watch) -> dict[str, dict[str, float]]:
    """Offset and bar [s] of the clock of each host against this machine's."""
    offsets: dict[str, Offset] = {}
    for _ in range(QUESTIONS):
        sent = time.time_ns()
        for host, answer in watch.ask("@clock", "/*").items():
            now = time.monotonic_ns()
            found = measured(sent, int(answer["now"]), time.time_ns(), now)
            offsets[host] = better(offsets.get(host), found, now)
    now = time.monotonic_ns()
    return {
        host: {"offset": round(offset.seconds, 6), "error": round(offset.aged(now), 6)}
        for host, offset in sorted(offsets.items())
    }


def _shown(found: dict[str, dict[str, float]]) -> str:
    cells = [
        (
            host,
            f"{known['offset'] * 1e3:+.2f} ms",
            f"{known['error'] * 1e3:.2f} ms",
            _explained(known["offset"], known["error"]),
        )
        for host, known in found.items()
    ]
    return table(("HOST", "CLOCK AHEAD", "+-", ""), cells, right=("CLOCK AHEAD", "+-"))


def _explained(offset: float, error: float) -> str:
    if abs(offset) > max(LARGE_S, error):
        return "differs: set one of them (NTP); nodes go by the listening host's time meanwhile"
    if error > VAGUE_S:
        return "a slow way there and back: ages across hosts are no better known than that"
    return "fine"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
