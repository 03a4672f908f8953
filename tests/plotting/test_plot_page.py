"""Claims about the page of plots, in a real browser, opened as a file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lodeline.cli import main
from lodeline.plotting.kinds import KINDS
from tests.dash.chromium import Chromium
from tests.plotting.test_plots import curve, made

SETTLED = "document.querySelectorAll('.card').length > 0 && time.charts.every((c) => !c.wished)"
INKED = """(() => {
  const {context, canvas} = time.charts.find((chart) => chart.figure.kind === '%s').surface;
  const {data} = context.getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
  return count / (canvas.width * canvas.height);
})()"""


@pytest.fixture(scope="module")
def file(rover: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made_file = tmp_path_factory.mktemp("page") / "rover.html"
    assert main(["plot", str(rover), "--html", str(made_file)]) == 0
    return made_file


@pytest.fixture
def page(chromium: Chromium, file: Path) -> Iterator[Chromium]:
    """The page, opened; it must cause no error, no warning and no request."""
    chromium.open(file.as_uri(), height=6000)
    assert chromium.comes_true(SETTLED)
    yield chromium
    assert chromium.run("performance.getEntriesByType('resource').map((each) => each.name)") == []
    assert chromium.troubles == []


def mouse(page: Chromium, kind: str, x: float, y: float, **more: Any) -> None:
    page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)


def place(page: Chromium, kind: str) -> dict[str, float]:
    """Where the drawing of a plot is on the screen."""
    found: dict[str, float] = page.run(
        f"(({{x, y, width, height}}) => ({{x, y, width, height}}))"
        f"(document.querySelector('#{kind} canvas').getBoundingClientRect())"
    )
    return found


def test_every_plot_is_there_and_drawn(page: Chromium) -> None:
    assert page.run("[...document.querySelectorAll('.card')].map((c) => c.id)") == list(KINDS)
    for kind in KINDS:
        assert page.comes_true(f"{INKED % kind} > 0.005"), kind


def test_its_numbers_are_those_of_the_plots(page: Chromium, rover: Path) -> None:
    plots = made(rover)
    of = "shown.figures.find((figure) => figure.kind === '%s')"
    for name in ("pose (EKF)", "odom", "truth"):
        path = f"{of % 'path'}.floor.trails.find((each) => each.name === '{name}')"
        x, y = curve(plots["path"], name)
        assert page.run(f"[...{path}.x]") == x
        assert page.run(f"[...{path}.y]") == pytest.approx(y, rel=1e-6)
    for kind, place_, name in (
        ("errors", 2, "error"),
        ("sigmas", 0, "σ x"),
        ("mahalanobis", 0, "nearest magnet"),
        ("gyro_bias", 0, "bx"),
    ):
        curves = f"{of % kind}.panels[{place_}].curves.find((each) => each.name === '{name}')"
        times, values = curve(plots[kind], name, place_)
        assert page.run(f"[...{curves}.x]") == times
        assert page.run(f"[...{curves}.y]") == pytest.approx(values, rel=1e-6)


def test_a_stretch_of_time_is_zoomed_in_all_plots_moved_and_left(page: Chromium) -> None:
    box = place(page, "yaw")
    left, right, y = box["x"] + float(page.run("LEFT")), box["x"] + box["width"] - 10, box["y"] + 40
    first, last = page.run("time.full")

    def at(part: float) -> float:
        return left + part * (right - left)

    def drag(begin: float, end: float, **more: Any) -> None:
        mouse(page, "mousePressed", at(begin), y, button="left", clickCount=1, **more)
        mouse(page, "mouseMoved", at(end), y, button="left", **more)
        mouse(page, "mouseReleased", at(end), y, button="left", clickCount=1, **more)

    drag(0.25, 0.5)
    span = last - first
    assert page.run("time.view") == pytest.approx([first + span / 4, first + span / 2], abs=0.02)
    assert page.comes_true(SETTLED)
    drag(0.5, 0.1, modifiers=8)
    low, high = page.run("time.view")
    assert (low, high - low) == pytest.approx((first + 0.35 * span, span / 4), abs=0.02)
    mouse(page, "mouseWheel", at(0.5), y, deltaX=0, deltaY=-200, modifiers=2)
    assert page.comes_true(f"time.view[1] - time.view[0] < {0.9 * span / 4}")
    page.run("document.getElementById('all').click()")
    assert page.run("time.view") == [first, last]


def test_under_the_pointer_stands_what_was_then(page: Chromium) -> None:
    box = place(page, "sigmas")
    left = page.run("LEFT")
    middle = box["x"] + left + 0.5 * (box["width"] - 10 - left)
    mouse(page, "mouseMoved", middle, box["y"] + 60)
    first, last = page.run("time.full")
    assert page.run("time.cursor") == pytest.approx((first + last) / 2, abs=0.02)
    told = page.run("""(() => {
      const said = [];
      const write = CanvasRenderingContext2D.prototype.fillText;
      CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
        said.push(text);
        write.call(this, text, ...rest);
      };
      const chart = time.charts.find((each) => each.figure.kind === 'sigmas');
      chart.draw(chart.surface.begin());
      CanvasRenderingContext2D.prototype.fillText = write;
      const {x, y} = chart.figure.panels[0].curves[0];
      return [said, `σ x  ${meaningful(y[nearest(x, time.cursor)])} mm`];
    })()""")
    assert told[1] in told[0]
    assert any(text.startswith("t = ") for text in told[0])


def test_the_legend_hides_and_shows(page: Chromium) -> None:
    buttons = "[...document.querySelectorAll('#path .legend button')]"
    button = f"{buttons}.find((each) => each.textContent === 'odom')"
    before = page.run(INKED % "path")
    page.run(f"{button}.click()")
    assert page.run(f"{button}.getAttribute('aria-pressed')") == "false"
    assert page.comes_true(f"{INKED % 'path'} < {before}")
    page.run(f"{button}.click()")
    assert page.comes_true(f"Math.abs({INKED % 'path'} - {before}) < 1e-6")


def test_both_axes_of_the_floor_have_one_scale(page: Chromium) -> None:
    chart = "time.charts.find((each) => each.figure.kind === 'path')"
    x, y = page.run(f"[{chart}.x(0.1) - {chart}.x(0), {chart}.y(0) - {chart}.y(0.1)]")
    assert x == pytest.approx(y)
    assert x > 10.0


def test_it_is_dark_where_the_desktop_is(chromium: Chromium, file: Path) -> None:
    lightness = []
    for scheme in ("light", "dark"):
        chromium.open(file.as_uri(), scheme=scheme)
        assert chromium.comes_true(SETTLED)
        colour = chromium.run("getComputedStyle(document.body.parentElement).backgroundColor")
        parts = [int(part) for part in colour.strip("rgb()").split(",")]
        lightness.append(math.fsum(parts) / 3)
    assert lightness[0] > 200
    assert lightness[1] < 50


def test_on_a_phone_nothing_is_wider_than_the_screen(chromium: Chromium, file: Path) -> None:
    chromium.open(file.as_uri(), width=390, height=844)
    assert chromium.comes_true(SETTLED)
    assert chromium.run("document.documentElement.scrollWidth") <= 390
