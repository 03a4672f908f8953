"""Claims about a real robot: three recordings of the magnet lab, in two settings.

The recordings belong to others and are not here: LODELINE_DATA names the folder that holds
`magnet_lab/`. The reference is an offline smoothing of all samples, good to a few mm.
"""

import math
import os
from bisect import bisect_right
from dataclasses import replace
from pathlib import Path

import pytest

from lodeline.ekf import Localizer, LocalizerParams
from lodeline.magnets import ReedBar, ReedBarParams
from lodeline.odometry import Odometry, OdometryParams

FOLDER = Path(os.environ["LODELINE_DATA"]) / "magnet_lab" if "LODELINE_DATA" in os.environ else None
pytestmark = pytest.mark.skipif(
    FOLDER is None or not FOLDER.is_dir(), reason="LODELINE_DATA names no folder with magnet_lab"
)

WHEELS, PARAMS = OdometryParams(), LocalizerParams()
Row = tuple[int, int, int, float]  # counts left and right, byte (a closed reed is 0), time [s]


def rows(run: str) -> list[Row]:
    assert FOLDER is not None
    lines = (FOLDER / f"{run}.txt").read_text().splitlines()
    table = [[float(word) for word in line.split()[:4]] for line in lines if line.strip()]
    return [(int(left), int(right), int(reeds), t) for left, right, reeds, t in table]


def as_in_the_course(all_rows: list[Row]) -> list[Row]:
    """5 Hz, 45 dots a turn, without the rows before the first and after the last motion."""
    moving = [i for i in range(1, len(all_rows)) if all_rows[i][:2] != all_rows[i - 1][:2]]
    kept = all_rows[moving[0] - 1 : moving[-1] + 1][::4]
    return [(8 * round(a / 8), 8 * round(b / 8), reeds, t) for a, b, reeds, t in kept]


class Reference:
    def __init__(self, run: str) -> None:
        assert FOLDER is not None
        lines = (FOLDER / f"reference_{run}.csv").read_text().splitlines()[1:]
        self._poses = [[float(word) for word in line.split(",")] for line in lines]
        self._times = [pose[0] for pose in self._poses]

    def at(self, t: float) -> tuple[float, float] | None:
        """Position [m] at time t; None outside of the span."""
        if not self._times[0] <= t <= self._times[-1]:
            return None
        i = min(bisect_right(self._times, t), len(self._times) - 1)
        before, after = self._poses[i - 1], self._poses[i]
        share = (t - before[0]) / (after[0] - before[0])
        x, y = (before[k] + share * (after[k] - before[k]) for k in (1, 2))
        return 1e-3 * x, 1e-3 * y


def rms(run: str, course: bool, wheels: OdometryParams, params: LocalizerParams) -> float:
    """Root mean square of the distance to the reference [m], at each row."""
    odometry, bar = Odometry(wheels), ReedBar(ReedBarParams())
    localizer, reference = Localizer(params), Reference(run)
    squares = []
    for left, right, reeds, t in as_in_the_course(rows(run)) if course else rows(run):
        out = odometry.update(round(t * 1e9), left, right)
        assert out is not None
        pose = (out.x, out.y, out.yaw)
        localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
        localizer.magnets(out.stamp_ns, bar.laterals(~reeds))
        estimate, true = localizer.estimate, reference.at(t)
        assert estimate is not None
        if true is not None:
            squares.append((estimate.x - true[0]) ** 2 + (estimate.y - true[1]) ** 2)
    assert len(squares) > 0.9 * (len(rows(run)) / (4 if course else 1)) - 20
    return math.sqrt(sum(squares) / len(squares))


FIGURES = [
    ("line1magnet", True, 0.0020),
    ("circles", True, 0.0030),
    ("oneloop", True, 0.0025),
    ("line1magnet", False, 0.0010),
    ("circles", False, 0.0018),
    ("oneloop", False, 0.0020),
]


@pytest.mark.parametrize(("run", "course", "limit"), FIGURES)
def test_the_defaults_stay_within_millimetres_of_the_reference(
    run: str, course: bool, limit: float
) -> None:
    figure = rms(run, course, WHEELS, PARAMS)
    print(f"{run}, {'5 Hz, 45 dots' if course else '20 Hz, 360 dots'}: {1e3 * figure:.2f} mm")
    assert figure <= limit


@pytest.mark.parametrize(
    ("run", "limit"), [("line1magnet", 0.0026), ("circles", 0.0030), ("oneloop", 0.0030)]
)
def test_the_lab_s_own_measurement_model_does_in_the_lab_s_own_setting(
    run: str, limit: float
) -> None:
    assert rms(run, True, WHEELS, replace(PARAMS, magnet_model="plain")) <= limit


def test_no_figure_hangs_on_a_parameter_that_is_just_so() -> None:
    """A quarter more or less of any parameter changes the mean figure by less than 10 %."""

    def mean(wheels: OdometryParams, params: LocalizerParams) -> float:
        return sum(rms(run, course, wheels, params) for run, course, _ in FIGURES) / len(FIGURES)

    best = mean(WHEELS, PARAMS)
    for factor in (0.75, 1.25):
        k = factor * WHEELS.distance_noise
        assert mean(replace(WHEELS, distance_noise=k), PARAMS) <= 1.10 * best
        for name in ("passage", "edge_sigma", "lateral_sigma", "gate"):
            other = replace(PARAMS, **{name: factor * getattr(PARAMS, name)})
            assert mean(WHEELS, other) <= 1.10 * best, (name, factor)
