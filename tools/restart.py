"""Start a node of a running pipeline again, also one that was given up.

A process that several nodes share is started again as a whole. What a node keeps over a crash
it keeps over this too. Exit codes: 0 restarting, 1 it could not be, 2 usage, 4 no such node.
"""

from __future__ import annotations

import argparse
import sys

EXIT_FAILED, EXIT_NOTHING = 1, 4
TIMEOUT_S = 2.0


def main(argv: list[str]) -> int:
    """Run `lodeline restart`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.bus import BusError
    from lodeline.params import nearest
    from lodeline.sessions import query
    from lodeline.watch import NothingThereError, choose

    try:
        target = choose(arguments.name)
    except NothingThereError as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING
    manifest = target.manifest
    if arguments.node not in manifest.nodes:
        guess = nearest(arguments.node, manifest.nodes)
        print(f"no node {arguments.node!r} in {manifest.name}{guess}", file=sys.stderr)
        return EXIT_NOTHING
    if why := manifest.refusal("restart", arguments.node):
        print(why, file=sys.stderr)
        return EXIT_FAILED
    key = f"{manifest.name}/@restart/*/{arguments.node}"
    try:
        answers = [data.decode() for _, data in query(target.folder, key, TIMEOUT_S)]
    except BusError:
        answers = []
    said = ", ".join(answers) or "its supervisor does not answer"
    place = manifest.places.get(arguments.node)
    if not answers and place not in (None, *manifest.hosts):
        said += f": is {place} linked (`lodeline doctor net`), and does the file there grant it?"
    restarting = "restarting" in answers
    print(f"{arguments.node}: {said}", file=sys.stdout if restarting else sys.stderr)
    return 0 if restarting else EXIT_FAILED


def parser() -> argparse.ArgumentParser:
    """The options of `lodeline restart`."""
    made = argparse.ArgumentParser(
        prog="lodeline restart",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("node", help="its name in the pipeline file")
    made.add_argument("--name", help="which pipeline, if several run")
    return made


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
