"""Measurements: how exact and how fast things are, beside what else there is.

`lodeline bench NAME --help` tells what each measures and what it takes. Exit codes: 0 measured,
1 failed, 2 usage, 4 nothing there to measure.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import sys
from pathlib import Path

from lodeline.loading import shipped


def main(argv: list[str]) -> int:
    """Run `lodeline bench`; the exit code."""
    arguments = parser().parse_args(argv)
    code: int = importlib.import_module(f"lodeline.bench.{arguments.name}").main(arguments.rest)
    return code


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench` takes."""
    known = benches()
    listed = "\n".join(f"    {name:10} {caption}" for name, caption in known.items())
    parser = argparse.ArgumentParser(
        "lodeline bench",
        description=f"{__doc__}\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=list(known), help="what to measure")
    parser.add_argument("rest", nargs=argparse.REMAINDER, metavar="...", help="what it takes")
    return parser


def benches() -> dict[str, str]:
    """Captions of the modules of lodeline/bench that can be run, found without importing them."""
    found = {}
    for file in sorted((Path(shipped("bench"))).glob("*.py")):
        tree = ast.parse(file.read_bytes())
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            found[file.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
