"""Begin a robot of your own: write a pipeline file with a known robot's constants and wiring.

The file explains each of its lines, and runs at once with a simulated robot. Nothing that is
already there is overwritten.

Exit codes: 0 written, 1 something is in the way, 2 usage.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from lodeline.loading import shipped

FAILED = 1
NEXT = """\
next:
{enter}  lodeline check     is everything wired as it should be?
  lodeline up        start it with a simulated robot (Ctrl-C stops it)
  lodeline doctor    on the robot: is everything there?"""


def main(argv: list[str]) -> int:
    """Run `lodeline new`; the exit code."""
    arguments = parser().parse_args(argv)
    sources = sorted((shipped("profiles") / "robots" / arguments.robot).glob("*.*"))
    folder: Path = arguments.folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
        there = [name for source in sources if (name := folder / source.name).exists()]
        if there:
            print(f"lodeline new: {there[0]} is already there", file=sys.stderr)
            return FAILED
        for source in sources:
            shutil.copyfile(source, folder / source.name)
            print(folder / source.name)
    except OSError as error:
        print(f"lodeline new: {error.filename}: {error.strerror}", file=sys.stderr)
        return FAILED
    enter = "" if folder.resolve() == Path.cwd() else f"  cd {folder}\n"
    print(NEXT.format(enter=enter), file=sys.stderr)
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline new` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline new",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder to write into")
    robots = sorted(path.name for path in (shipped("profiles") / "robots").iterdir())
    parser.add_argument("--robot", choices=robots, required=True, help="which robot it is like")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
