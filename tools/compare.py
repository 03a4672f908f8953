"""Lay two runs over each other: how far apart are position, yaw and speed?

Takes recordings (MCAP) or folders of tables of `lodeline replay --csv`. Of each it compares the
pose of the filter, or odometry where there is none; --key names another. B is interpolated at the
stamps of A. Exit codes: 0 fine, 1 failed, 2 usage, 4 not there, or nothing
in common.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.terminal.ending import ended

if TYPE_CHECKING:  # loaded when the arguments are known to be good
    from lodeline.plotting.comparison import Comparison, Side


def main(argv: list[str]) -> int:
    """Run `lodeline compare`; the exit code."""
    args = parser().parse_args(argv)
    return ended(lambda: _compare(args))


def parser() -> argparse.ArgumentParser:
    """What `lodeline compare` takes."""
    made = argparse.ArgumentParser(
        "lodeline compare",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("a", type=Path, metavar="A", help="MCAP file, or folder of tables")
    made.add_argument("b", type=Path, metavar="B", help="the other one")
    made.add_argument(
        "--key",
        action="append",
        default=[],
        metavar="KEY",
        help="which pose to take; given twice: that of A, that of B",
    )
    made.add_argument(
        "--from-start", action="store_true", help="count the time of each from its own beginning"
    )
    made.add_argument("--png", type=Path, metavar="DIR", help="one PNG file for each plot")
    made.add_argument("--html", type=Path, metavar="FILE", help="one page with all of them")
    made.add_argument("--json", action="store_true", help="print JSON, in m, rad and m/s")
    return made


def _compare(args: argparse.Namespace) -> int:
    from lodeline.plotting import page, png
    from lodeline.plotting.comparison import compare, figures, side
    from lodeline.plotting.run import Run

    if len(args.key) > 2:
        print("--key is given twice at most: for A, and for B", file=sys.stderr)
        return 2
    keys = [None, None] if not args.key else [args.key[0], args.key[-1]]
    a, b = (
        side(Run(path), key, from_start=args.from_start)
        for path, key in zip((args.a, args.b), keys, strict=True)
    )
    found = compare(a, b)
    name = f"{a.name} and {b.name}"
    if args.png is not None:
        png.write(figures(found), args.png, name)
    if args.html is not None:
        facts = f"{found.seconds:.1f} s in common"
        page.write(figures(found), args.html, name, facts, found.left_out)
    print(json.dumps(_as_json(found), indent=1) if args.json else _as_text(found))
    for what, why in found.left_out.items():
        print(f"left out {what}: {why}", file=sys.stderr)
    return 0


def _as_json(found: Comparison) -> dict[str, object]:
    def said(each: Side) -> dict[str, object]:
        return {"name": each.name, "key": each.key, "samples": len(each.poses)}

    return {
        "a": said(found.a),
        "b": said(found.b),
        "seconds": found.seconds,
        "differences": {
            each.name: {
                "unit": each.unit,
                "rms": each.rms,
                "largest": each.largest[0],
                "at": each.largest[1],
                "samples": len(each.values),
            }
            for each in found.differences
        },
        "left_out": found.left_out,
    }


def _as_text(found: Comparison) -> str:
    from lodeline.tables import table

    shown = {"m": (1e3, "mm"), "rad": (math.degrees(1.0), "deg"), "m/s": (1e3, "mm/s")}
    rows = []
    for each in found.differences:
        scale, unit = shown[each.unit]
        largest, when = each.largest
        numbers = (f"{scale * each.rms:.3f}", f"{scale * largest:.3f}", f"{when:.2f}")
        rows.append((each.name, *numbers[:2], unit, numbers[2], str(len(each.values))))
    headings = ("B less A", "RMS", "largest", "unit", "at s", "samples")
    head = [f"{word}: {each.name}, {each.key}" for word, each in (("A", found.a), ("B", found.b))]
    text = table(headings, rows, ("RMS", "largest", "at s", "samples"))
    return "\n".join([*head, f"{found.seconds:.2f} s in common", text])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
