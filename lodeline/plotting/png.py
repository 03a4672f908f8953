"""Plots as PNG files, for reports: white, 200 dots an inch, as wide as a page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from lodeline.plotting import NoMatplotlibError
from lodeline.plotting.figure import Band, Curve, Figure, Floor, Limit, Panel
from lodeline.plotting.palette import light

if TYPE_CHECKING:  # matplotlib takes half a second to load, and not everybody has it
    from matplotlib.axes import Axes

WIDTH_IN, PANEL_IN, SINGLE_IN, DPI = 7.4, 1.75, 3.1, 200
FLOOR_IN = (3.2, 7.4)
LEGEND_COLUMNS = 5
NOTE_LETTERS = 110
DASH = (0, (5, 2.2))
MARGIN = 0.08
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.linewidth": 0.6,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "legend.frameon": False,
    "legend.handlelength": 1.7,
    "legend.columnspacing": 1.4,
    "legend.borderaxespad": 0.0,
    "path.simplify": True,
}


def write(figures: Sequence[Figure], folder: Path, name: str) -> list[Path]:
    """Draw each figure into `folder`/KIND.png; the files. NoMatplotlibError, OSError."""
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure as Sheet
        from matplotlib.layout_engine import ConstrainedLayoutEngine
    except ImportError:
        raise NoMatplotlibError(
            "PNG files are drawn by matplotlib, which is not installed: "
            "pip install 'lodeline[plot]' (--html works without it)"
        ) from None
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for figure in figures:
        with rc_context(_style()):
            layout = ConstrainedLayoutEngine(h_pad=0.03, w_pad=0.05)
            sheet = Sheet(figsize=_size(figure), dpi=DPI, layout=layout)
            rows = max(1, len(figure.panels))
            axes = sheet.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
            if figure.floor is not None:
                _floor(axes[0], figure.floor)
            for panel, place in zip(figure.panels, axes, strict=False):
                _panel(place, panel)
            if figure.panels:
                axes[-1].set_xlabel("time [s]")
                axes[0].set_xlim(*_span(figure.panels))
            _head(list(axes), figure, name)
            file = folder / f"{figure.kind}.png"
            sheet.align_ylabels()
            tight = "tight" if figure.floor is not None else None
            facts = {"Title": figure.title, "Source": name}
            sheet.savefig(file, metadata=facts, bbox_inches=tight, pad_inches=0.1)
            files.append(file)
    return files


def _style() -> Any:
    colours = light()
    return STYLE | {
        "text.color": colours["ink"],
        "axes.labelcolor": colours["ink-2"],
        "xtick.color": colours["ink-3"],
        "ytick.color": colours["ink-3"],
        "axes.edgecolor": colours["ink-3"],
        "grid.color": colours["grid"],
    }


def _size(figure: Figure) -> tuple[float, float]:
    if figure.floor is None:
        count = len(figure.panels)
        return WIDTH_IN, 0.75 + (SINGLE_IN if count == 1 else count * PANEL_IN)
    west, east, south, north = _reach(figure.floor)
    high = (WIDTH_IN - 0.7) * (north - south) / (east - west) + 1.1
    return WIDTH_IN, min(max(high, FLOOR_IN[0]), FLOOR_IN[1])


def _head(places: Sequence[Axes], figure: Figure, name: str) -> None:
    """Title and note to the left, the legend on a line of its own below them."""
    from matplotlib.transforms import offset_copy

    axes = places[0]
    unique: dict[str, Any] = {}
    for handles, labels in (place.get_legend_handles_labels() for place in places):
        unique |= dict(zip(labels, handles, strict=True))
    columns = min(len(unique), LEGEND_COLUMNS)
    lift = 2 + 15 * -(-len(unique) // LEGEND_COLUMNS)
    note = fill(f"{name}: {figure.note}" if figure.note else name, NOTE_LETTERS)
    grey = {"fontsize": 7.8, "color": light()["ink-3"]}
    axes.annotate(note, (0, 1), (0, lift + 6), "axes fraction", "offset points", **grey)  # type: ignore[arg-type]
    axes.set_title(
        figure.title,
        loc="left",
        fontsize=11.5,
        fontweight="bold",
        pad=lift + 18 + 10 * note.count("\n"),
    )
    if unique:
        axes.legend(
            list(unique.values()),
            list(unique),
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            bbox_transform=offset_copy(
                axes.transAxes, axes.get_figure(root=True), 0.0, 4.0, "points"
            ),
            ncols=columns,
            fontsize=8.2,
        )


def _panel(axes: Axes, panel: Panel) -> None:
    colours = light()
    axes.set_ylabel(f"{panel.label} [{panel.unit}]" if panel.unit else panel.label)
    if panel.log:
        _decades(axes)
    for band in panel.bands:
        _band(axes, band)
    for curve in panel.curves:
        _curve(axes, curve)
    for limit in panel.limits:
        _limit(axes, limit)
    if panel.rows:
        axes.broken_barh([], (0, 0))
        for row, begin, end in panel.spans:
            least = max(end - begin, 1e-3)
            axes.broken_barh([(begin, least)], (row - 0.36, 0.72), color=colours["ekf"], lw=0.4)
        axes.set_yticks(range(1, len(panel.rows) + 1), panel.rows)
        axes.set_ylim(0.4, len(panel.rows) + 0.6)
        axes.tick_params(axis="y", length=0)
    elif not panel.log:
        axes.margins(y=MARGIN)


def _decades(axes: Axes) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _curve(axes: Axes, curve: Curve) -> None:
    colour = light()[curve.colour]
    y = [math.nan if value is None else value for value in curve.y]
    if curve.style == "dots":
        look: dict[str, Any] = {"marker": "o", "linestyle": "", "markeredgewidth": 0}
        look |= {"markersize": 2.2 if curve.faint else 3.2, "alpha": 0.35 if curve.faint else 0.85}
        axes.plot(curve.x, y, color=colour, label=curve.name, **look)
        return
    width = 3.6 if curve.faint else 1.25
    axes.plot(
        curve.x,
        y,
        color=colour,
        linewidth=width,
        alpha=0.38 if curve.faint else 1.0,
        linestyle=DASH if curve.dashed else "-",
        solid_joinstyle="round",
        label=curve.name,
    )


def _band(axes: Axes, band: Band) -> None:
    colour = light()[band.colour]
    axes.fill_between(
        band.x, band.low, band.high, color=colour, alpha=0.14, linewidth=0, label=band.name
    )


def _limit(axes: Axes, limit: Limit) -> None:
    colour = light()["bad"]
    text = f"{limit.name} {limit.value:.3g}"
    axes.axhline(limit.value, color=colour, linewidth=1.0, linestyle=(0, (4, 3)), label=text)


def _span(panels: Sequence[Panel]) -> tuple[float, float]:
    ends = [
        x for panel in panels for each in panel.curves if each.x for x in (each.x[0], each.x[-1])
    ]
    ends += [x for panel in panels for span in panel.spans for x in span[1:]]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    pad = 0.01 * (high - low) or 0.5
    return low - pad, high + pad


def _reach(floor: Floor) -> tuple[float, float, float, float]:
    """West, east, south and north end of what must be seen [m], with a margin."""
    xs = [x for trail in floor.trails for x in trail.x] + [x for x, _ in floor.seen]
    ys = [y for trail in floor.trails for y in trail.y if y is not None]
    ys += [y for _, y in floor.seen]
    margin = 0.04 * max(max(xs) - min(xs), max(ys) - min(ys), 0.05)
    return min(xs) - margin, max(xs) + margin, min(ys) - margin, max(ys) + margin


def _floor(axes: Axes, floor: Floor) -> None:
    from matplotlib.patches import Ellipse as Patch

    colours = light()
    axes.set_aspect("equal", adjustable="box")
    if floor.magnets:
        xs, ys = zip(*floor.magnets, strict=True)
        axes.plot(xs, ys, ".", color=colours["magnet"], markersize=2.4, label="magnets", zorder=1)
    for trail in floor.trails:
        _curve(axes, trail)
    for x, y, a, b, angle in floor.ellipses:
        degrees = math.degrees(angle)
        look: dict[str, Any] = {"linewidth": 0.7, "alpha": 0.9, "fill": False, "zorder": 3}
        axes.add_patch(Patch((x, y), 2 * a, 2 * b, angle=degrees, color=colours["ink"], **look))
    if floor.seen:
        xs, ys = zip(*floor.seen, strict=True)
        look = {"markersize": 6.5, "markerfacecolor": "none", "markeredgewidth": 0.9, "zorder": 2}
        axes.plot(xs, ys, "o", color=colours["hit"], label="magnets met", **look)
        xs, ys = zip(*floor.hits, strict=True)
        look = {"markersize": 4.0, "markeredgewidth": 0.7, "alpha": 0.6, "zorder": 2}
        axes.plot(xs, ys, "+", color=colours["hit"], label="where they were seen", **look)
    main = floor.trails[-1]
    if main.x:
        for place, marker, label in ((0, "o", "start"), (-1, "s", "end")):
            look = {"markersize": 5.0, "markerfacecolor": "white", "zorder": 5, "linestyle": ""}
            at_x, at_y = main.x[place], main.y[place]
            axes.plot(
                [at_x],
                [math.nan if at_y is None else at_y],
                marker,
                color=colours["ink"],
                label=label,
                **look,
            )
    west, east, south, north = _reach(floor)
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
