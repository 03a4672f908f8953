"""Say everything that is wrong with a pipeline file, before anything starts.

Prints each fault as `file:line:column: what, and the nearest right name`; exits 3 if there is one.
Also says if a pipeline runs that was started from this file before it was edited.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from lodeline.pipeline.edited import edited, told
from lodeline.pipeline.load import PipelineError, find, load
from lodeline.pipeline.model import Pipeline
from lodeline.run_folder import running

INVALID = 3


def main(argv: list[str]) -> int:
    arguments = parser().parse_args(argv)
    try:
        file = find(arguments.file)
        pipeline = load(file, arguments.set)
    except PipelineError as error:
        if arguments.json:
            print(json.dumps({"fine": False, "faults": [asdict(fault) for fault in error.faults]}))
        else:
            print(error)
        print(_count(len(error.faults), "fault"), file=sys.stderr)
        return INVALID
    for warning in pipeline.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    for runs in running(pipeline.name):
        manifest = runs.manifest
        if manifest.file == str(pipeline.file) and (text := told(edited(manifest.sources))):
            print(f"{manifest.name}@{manifest.host}: {text}", file=sys.stderr)
    print(json.dumps(_described(pipeline)) if arguments.json else f"{file}: {_summary(pipeline)}")
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline check` takes."""
    parser = argparse.ArgumentParser(prog="lodeline check", description=__doc__)
    parser.add_argument(
        "file",
        nargs="?",
        help="pipeline file or profile (default: ./pipeline.yaml, else the one that comes along)",
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="NODE.PARAM=VALUE", help="override a param"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _described(pipeline: Pipeline) -> dict[str, object]:
    return {
        "fine": True,
        "faults": [],
        "warnings": list(pipeline.warnings),
        "name": pipeline.name,
        "file": str(pipeline.file),
        "digest": pipeline.digest,
        "hosts": list(pipeline.hosts),
        "nodes": [spec.name for spec in pipeline.nodes],
        "keys": {key: cls.__name__ for key, cls in pipeline.key_types().items()},
    }


def _summary(pipeline: Pipeline) -> str:
    counts = (
        _count(len(pipeline.nodes), "node"),
        _count(len(pipeline.key_types()), "key"),
        _count(len(pipeline.hosts), "host"),
    )
    return f"{', '.join(counts)}: fine"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
