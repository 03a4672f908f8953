"""Exercises for a class: write what is missing in a node, and see whether it is right.

    lodeline grade                          which exercises there are
    lodeline grade odometry --blank my.py   a node with a part to write
    lodeline grade odometry my.py           over two simulated drives, beside the reference

Exit codes: 0 right, 1 not right yet, 2 usage, 4 no such file.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from math import isfinite, isnan
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the simulator is loaded when there is something to grade
    from lodeline.grading import Exercise, Grade

WRONG, NOTHING = 1, 4


def main(argv: list[str]) -> int:
    """Run `lodeline grade`; the exit code."""
    parse = parser()
    args = parse.parse_args(argv)
    from lodeline.grading import EXERCISES, GradingError, grade

    if args.exercise is None:
        if args.blank is not None:
            parse.error(f"of which exercise? ({', '.join(EXERCISES)})")
        titles = {exercise.name: exercise.title for exercise in EXERCISES.values()}
        lines = (f"{name:12} {title}" for name, title in titles.items())
        print(json.dumps(titles, indent=1) if args.json else "\n".join(lines))
        return 0
    if args.exercise not in EXERCISES:
        from lodeline.params import nearest

        parse.error(f"no exercise {args.exercise!r}{nearest(args.exercise, EXERCISES)}")
    exercise = EXERCISES[args.exercise]
    if args.blank is not None:
        return _write(exercise, args.blank)
    if args.file is None:
        parse.error("which file? (a new one: --blank FILE)")
    if not args.file.exists():
        print(f"{args.file}: there is no such file", file=sys.stderr)
        return NOTHING
    try:
        with contextlib.redirect_stdout(sys.stderr):  # what the node prints is no part of ours
            found = grade(exercise, args.file, args.seed or (1, 2))
    except GradingError as error:
        print(error, file=sys.stderr)
        return WRONG
    print(json.dumps(_as_json(found), indent=1) if args.json else _as_text(found))
    return 0 if found.passed else WRONG


def parser() -> argparse.ArgumentParser:
    """What `lodeline grade` takes."""
    parser = argparse.ArgumentParser(
        "lodeline grade", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("exercise", nargs="?", help="which one (default: list them)")
    parser.add_argument("file", nargs="?", type=Path, help="your node")
    parser.add_argument("--blank", type=Path, metavar="FILE", help="write a node to begin with")
    parser.add_argument(
        "--seed", type=int, action="append", metavar="N", help="another drive (default: 1 and 2)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _write(exercise: Exercise, file: Path) -> int:
    try:
        with file.open("x") as stream:
            stream.write(exercise.blank())
    except FileExistsError:
        print(f"{file} is there already, and stays as it is: give another name", file=sys.stderr)
        return WRONG
    except OSError as error:
        print(f"lodeline grade: {file}: {error.strerror}", file=sys.stderr)
        return WRONG
    print(f"{file}: write what is missing, then: lodeline grade {exercise.name} {file}")
    return 0


def _as_json(found: Grade) -> dict[str, object]:
    return {
        "passed": found.passed,
        "wanted": found.wanted,
        "sent": found.sent,
        "differences": {
            each.quantity.name: {
                "worst": each.worst if isfinite(each.worst) else None,  # JSON knows no others
                "at": each.seconds,
                "fine": each.fine,
            }
            for each in found.differences
        },
        "raised": found.raised,
        "hint": found.hint,
    }


def _as_text(found: Grade) -> str:
    lines = [f"sent {found.sent} of {found.wanted} samples"]
    for each in found.differences if found.sent else ():
        quantity = each.quantity
        if not isfinite(each.worst):
            what = f"is no number at {each.seconds:.2f} s" if isnan(each.worst) else "has no sample"
            lines.append(f"{quantity.name:4} {what}: wrong")
            continue
        verdict = "right" if each.fine else f"wrong, most at {each.seconds:.2f} s"
        lines.append(
            f"{quantity.name:4} off by at most {each.worst:.3g} {quantity.unit} "
            f"(allowed {quantity.tolerance:g}): {verdict}"
        )
    if found.raised:
        lines.append(f"raised {found.raised}")
    if found.hint:
        lines.append(f"hint: {found.hint}")
    return "\n".join([*lines, "PASSED" if found.passed else "not yet"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
