"""Print a script by which a shell completes verbs, options and file names.

bash: add `eval "$(lodeline completion bash)"` to ~/.bashrc.
zsh: `lodeline completion zsh > FOLDER/_lodeline`, FOLDER being one of $fpath.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def main(argv: list[str]) -> int:
    """Run `lodeline completion`; the exit code."""
    arguments = parser().parse_args(argv)
    import shtab

    from lodeline.terminal.verbs import root_parser

    root = root_parser()
    _complete_files(root)
    print(shtab.complete(root, shell=arguments.shell))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline completion` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline completion",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("shell", choices=["bash", "zsh"])
    return parser


def _complete_files(parser: argparse.ArgumentParser) -> None:
    """Have file names completed where a path is taken."""
    import shtab

    for action in parser._actions:  # argparse has no other way to what a parser takes
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                _complete_files(below)
        elif action.metavar == "DIR":
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif action.type is Path or action.dest == "file":
            action.complete = shtab.FILE  # type: ignore[attr-defined]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
