"""All plots of a run, written where they are wanted."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

from lodeline.plotting import page, png
from lodeline.plotting.figure import Figure
from lodeline.plotting.kinds import figures
from lodeline.plotting.run import Run


class Drawn(NamedTuple):
    """The plots, why others are left out, and the files of each by its kind."""

    figures: list[Figure]
    left_out: dict[str, str]
    files: dict[str, list[str]]


def draw(run: Run, folder: Path | None, html: Path | None) -> Drawn:
    """PNG files into a folder, one page with all, both or none; NoMatplotlibError, OSError."""
    made, left_out = figures(run)
    files: dict[str, list[str]] = {each.kind: [] for each in made}
    if folder is not None:
        for figure, file in zip(made, png.write(made, folder, run.path.name), strict=True):
            files[figure.kind].append(str(file))
    if html is not None:
        page.write(made, html, run.path.name, _facts(run), left_out)
        for each in files.values():
            each.append(str(html))
    return Drawn(made, left_out, files)


def say(drawn: Drawn, folder: Path | None, html: Path | None) -> None:
    """For people: what is left out, and what was written, on standard error."""
    for kind, why in drawn.left_out.items():
        print(f"left out {kind}: {why}", file=sys.stderr)
    count = len(drawn.figures)
    files = "1 file" if count == 1 else f"{count} files"
    written = [f"{files} in {folder}"] if folder is not None else []
    written += [str(html)] if html is not None else []
    done = f"written: {', '.join(written)}" if written else "none drawn: --png DIR or --html FILE"
    print(done, file=sys.stderr)


def _facts(run: Run) -> str:
    return f"{(run.end - run.start) * 1e-9:.1f} s, {run.source}".rstrip(", ")
