"""The claim that the answers to the course's questions are what the commands beside them print."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from lodeline.cli import main
from tests.docs.documents import blocks
from tests.support.live import ROOT

PAGE = (ROOT / "docs" / "recording.md").read_text()
BEGUN_20_MM_OFF = ["--set", "ekf.initial_pose=[0.02, 0, 0]"]
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording and its truth, as the page's first commands make them."""
    here = tmp_path_factory.mktemp("page")
    data = ROOT / "tests/data/recordings"
    (text,) = [b.text for b in blocks("docs/recording.md") if b.order == "file truth.yaml"]
    (here / "truth.yaml").write_text(text)
    lab = ["bag", "import", f"{data}/loop.txt", "--format", "magnet-lab", "--course"]
    assert main([*lab, "-o", f"{here}/loop.mcap"]) == 0
    truth = ["bag", "import", f"{data}/loop_truth.csv", "--map", f"{here}/truth.yaml"]
    assert main([*truth, "-o", f"{here}/truth.mcap"]) == 0
    return here


def rows(heading: str) -> list[tuple[str, list[float]]]:
    """First cells of a table, and the numbers that the others begin with."""
    table = PAGE.partition(f"| {heading}")[2].partition("|---")[2].partition("\n\n")[0]
    cells = [line.strip("| ").split(" | ") for line in table.splitlines()[1:]]
    found = [(first, [float(each.split()[0]) for each in more]) for first, *more in cells]
    assert len(found) >= 4
    return found


def millimetres(folder: Path, capsys: Capture, *settings: str, key: str = "pose") -> float:
    """RMS from the truth after a replay."""
    run = folder / "run.mcap"
    replay = ["replay", f"{folder}/loop.mcap", "--pipeline", "magnet-lab", "--force"]
    assert main([*replay, "-o", str(run), *settings]) == 0
    capsys.readouterr()
    compare = ["compare", str(run), f"{folder}/truth.mcap", "--key", key, "--key", "truth"]
    assert main([*compare, "--json"]) == 0
    return 1e3 * float(json.loads(capsys.readouterr().out)["differences"]["position"]["rms"])


def mean_nis(folder: Path, capsys: Capture) -> float:
    """Of the run that `millimetres` left."""
    capsys.readouterr()
    assert main(["plot", f"{folder}/run.mcap", "--html", f"{folder}/run.html"]) == 0
    found = re.search(r"^nis .* mean ([\d.]+)", "".join(capsys.readouterr()), re.MULTILINE)
    assert found is not None
    return float(found[1])


def test_how_far_off_it_is(folder: Path, capsys: Capture) -> None:
    told = re.search(r"EKF is ([\d.]+) mm RMS from the truth, plain odometry (\d+) mm", PAGE)
    assert told is not None
    assert millimetres(folder, capsys) == pytest.approx(float(told[1]), abs=0.06)
    assert millimetres(folder, capsys, key="odom") == pytest.approx(float(told[2]), abs=0.6)


def test_which_start_pose(folder: Path, capsys: Capture) -> None:
    for start, (told,) in rows("start off by"):
        off = 1e-3 * float(start.split()[0])
        begun = ["--set", f"ekf.initial_pose=[{off}, 0, 0]"]
        assert millimetres(folder, capsys, *begun) == pytest.approx(told, abs=0.06), start


def test_how_the_one_noise_parameter_is_tuned(folder: Path, capsys: Capture) -> None:
    for noise, (nis, told) in rows("distance_noise"):
        setting = ["--set", f"odometry.distance_noise={noise.split()[0]}"]
        assert millimetres(folder, capsys, *setting) == pytest.approx(told, abs=0.06), noise
        assert mean_nis(folder, capsys) == pytest.approx(nis, abs=0.006), noise


def test_what_the_gate_does(folder: Path, capsys: Capture) -> None:
    for gate, (told,) in rows("gate, start 20 mm off"):
        setting = ["--set", "ekf.association=nearest", "--set", f"ekf.gate={gate}"]
        off = millimetres(folder, capsys, *setting, *BEGUN_20_MM_OFF)
        assert off == pytest.approx(told, abs=0.06), gate
