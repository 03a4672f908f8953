"""The claim that the commands of docs/plots.md lead to the plots that it names."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lodeline.cli import main
from tests.dead_reckoning.test_lecture_files import imu_file, motor_file
from tests.support.live import ROOT

PAGE = (ROOT / "docs" / "plots.md").read_text()
LECTURE = {"path", "yaw", "speed"}
FOLDERS = ("plots", "compared", "wheels", "inertial")


def test_each_chain_of_commands_leads_to_its_plots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(ROOT / "tests/data/recordings/loop.txt", tmp_path / "oneloop.txt")
    motor_file(tmp_path / "motor.txt", cumulative=False)
    imu_file(tmp_path / "imu.txt", -1)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 4
    for line in "".join(blocks).splitlines():
        word, *arguments = line.split()
        assert word == "lodeline"
        assert main(arguments) == 0, line
    made = {folder: {file.stem for file in Path(folder).glob("*.png")} for folder in FOLDERS}
    assert made["wheels"] >= LECTURE
    assert LECTURE | {"attitude"} <= made["inertial"]
    assert made["compared"] == {"path", "yaw", "speed", "differences"}
    told = set(re.findall(r"`(\w+)`", PAGE.partition("| file |")[2].partition("\n\n")[0]))
    assert made["plots"] | {"attitude", "gyro_bias", "heading_std", "errors", "nees"} == told
    assert Path("plots.html").exists()
