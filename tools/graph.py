"""Draw a pipeline file: which node sends which key to whom.

Text by default; nothing needs to run. Exit codes: 0 drawn, 2 usage, 3 invalid pipeline.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict


def main(argv: list[str]) -> int:
    """Run `lodeline graph`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.pipeline.load import PipelineError, find, load
    from lodeline.terminal.drawing import as_dot, as_mermaid, as_svg, as_text
    from lodeline.terminal.wires import wires_of

    try:
        pipeline = load(find(arguments.file))
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 3
    if arguments.form == "json":
        print(json.dumps([asdict(wire) for wire in wires_of(pipeline)], indent=1))
    else:
        forms = {"mermaid": as_mermaid, "svg": as_svg, "dot": as_dot, "text": as_text}
        print(forms[arguments.form](pipeline))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline graph` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline graph",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "file",
        nargs="?",
        help="pipeline file or profile (default: ./pipeline.yaml, else the one that comes along)",
    )
    forms = parser.add_mutually_exclusive_group()
    parser.set_defaults(form="text")
    for form, caption in (
        ("mermaid", "a Mermaid flow chart, for Markdown"),
        ("svg", "a picture"),
        ("dot", "a graph for Graphviz"),
        ("json", "one JSON list of all wires"),
    ):
        forms.add_argument(f"--{form}", action="store_const", dest="form", const=form, help=caption)
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
