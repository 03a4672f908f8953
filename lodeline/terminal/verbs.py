"""The parsers of all verbs: each program of tools/ shows its own by `parser()`."""

from __future__ import annotations

import runpy
from argparse import ArgumentParser
from typing import cast

from lodeline.loading import shipped


def parsers() -> dict[str, ArgumentParser]:
    """Parsers by verb; KeyError for a tool without a function `parser`."""
    return {
        file.stem: runpy.run_path(str(file), run_name=f"lodeline_tool_{file.stem}")["parser"]()
        for file in sorted(shipped("tools").glob("*.py"))
    }


def caption(parser: ArgumentParser) -> str:
    """The first line of what a parser says of its verb."""
    return (parser.description or "").strip().partition("\n")[0]


def root_parser() -> ArgumentParser:
    """One parser with every verb below it, as shells see `lodeline`."""
    verbs = parsers()

    def made(prog: str, **_: object) -> ArgumentParser:
        return verbs[prog.rpartition(" ")[2]]

    root = ArgumentParser("lodeline")
    root.add_argument("-V", "--version", action="version", version="lodeline")
    factory = cast(type[ArgumentParser], made)
    below = root.add_subparsers(metavar="VERB", parser_class=factory)
    for verb, parser in verbs.items():
        below.add_parser(verb, help=caption(parser))
    return root
