"""The claim that what the README says can be done as it says it."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.live import ROOT, Up, environment

README = ROOT / "README.md"
KEPT = ("nodes", "tests/data/recordings", "pipeline.yaml")


def blocks(language: str) -> list[str]:
    """Code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(), re.DOTALL)


def commands() -> list[str]:
    """Lines of all shell blocks, without their comments."""
    lines = [
        line.partition("#")[0].strip() for block in blocks("sh") for line in block.splitlines()
    ]
    return [line for line in lines if line]


def shell(line: str, folder: Path, run: Path) -> subprocess.CompletedProcess[str]:
    """Run a line as a user would, with the environment's programs on the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["sh", "-c", line],
        cwd=folder,
        env={**environment(run), "PATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with what the commands name."""
    for name in KEPT:
        source, target = ROOT / name, tmp_path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy(source, target)
    return tmp_path


def test_the_first_two_commands_are_the_ones_of_the_makefile() -> None:
    assert commands()[:2] == ["make demo", "make test"]
    makefile = (ROOT / "Makefile").read_text()
    assert re.search(r"^demo:", makefile, re.MULTILINE)
    assert re.search(r"^test:", makefile, re.MULTILINE)


def test_what_is_said_of_the_running_demo_holds() -> None:
    with Up(ROOT / "pipeline.yaml") as up:
        for line in ("topic hz", "topic echo pose", "ps"):
            assert f"lodeline {line}" in commands()
            more = ["-n", "1"] if "echo" in line else []
            result = up.call(*line.split(), *more)
            assert result.returncode == 0, result.stderr
            assert result.stdout


def test_the_recording_door_leads_to_a_path(checkout: Path, short_folder: Path) -> None:
    lines = [line for line in commands() if "bag import" in line or "replay" in line]
    assert len(lines) == 2
    for line in lines:
        result = shell(line, checkout, short_folder)
        assert result.returncode == 0, result.stderr
    with (checkout / "tables" / "pose.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert list(rows[0])[:4] == ["stamp", "x", "y", "yaw"]
    assert len(rows) > 800
    settings = re.findall(r"`(--set .*?)`", README.read_text())
    assert len(settings) >= 4
    for setting in settings:
        profile = "pipeline.yaml" if "attitude" in setting else "magnet-lab"
        result = shell(f"lodeline check {profile} {setting}", checkout, short_folder)
        assert result.returncode == 0, f"{setting}: {result.stdout}{result.stderr}"


def test_the_robot_door_leads_to_a_valid_pipeline(checkout: Path, short_folder: Path) -> None:
    text = (checkout / "pipeline.yaml").read_text()
    assert text.count("bus: sim,") == 3
    without = re.sub(r"  simulator:.*?\n\n", "", text, flags=re.DOTALL).replace(
        "bus: sim", "bus: 1"
    )
    (checkout / "my_robot.yaml").write_text(without)
    (line,) = [line for line in commands() if "check" in line]
    result = shell(line, checkout, short_folder)
    assert result.returncode == 0, result.stdout


def test_the_node_of_the_class_runs_in_the_pipeline(checkout: Path, short_folder: Path) -> None:
    (program,) = blocks("python")
    (entry,) = blocks("yaml")
    assert len(entry.splitlines()) == 4
    (checkout / "speed_limit.py").write_text(program)
    file = checkout / "pipeline.yaml"
    file.write_text(f"{file.read_text()}\n{entry}")
    with Up(file, "--set", "speed_limit.fastest=0.01") as up:
        result = up.call("topic", "echo", "excess", "-n", "1", "--timeout", "10")
    assert result.returncode == 0, result.stderr
    (speed,) = re.findall(r"^v: (\S+) m/s$", result.stdout, re.MULTILINE)
    assert float(speed) > 0.01


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#]+)\)", README.read_text()))
def test_links_lead_somewhere(target: str) -> None:
    assert target.startswith("https://") or (ROOT / target).exists(), target
