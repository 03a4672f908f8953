"""The claim that an installed wheel runs the same pipeline as a checkout."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.live import ROOT, environment

SHIPPED = ("nodes", "tools")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    return file


def test_the_wheel_holds_library_messages_nodes_tools_profiles_and_pipeline(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {"lodeline/pipeline.yaml", "lodeline_msgs/codec.py", "lodeline/bus.py"} <= names
    assert "lodeline/profiles/magnet_lab.yaml" in names
    for folder in SHIPPED:
        here = {f"lodeline/{folder}/{file.name}" for file in (ROOT / folder).glob("*.py")}
        assert here <= names
    assert not [name for name in names if name.startswith("tests/")]


def test_an_installed_wheel_runs_the_default_pipeline(
    wheel: Path, tmp_path: Path, short_folder: Path
) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(site)
    # Its folder comes before the checkout that this environment was made from.
    variables = {**environment(short_folder), "PYTHONPATH": str(site)}
    where = "import lodeline, lodeline_msgs; print(lodeline.__file__, lodeline_msgs.__file__)"
    found = subprocess.run(
        [sys.executable, "-P", "-c", where],
        env=variables,
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    assert found.stdout.count(str(site)) == 2
    result = subprocess.run(
        [sys.executable, "-P", "-m", "lodeline", "up", "--seconds", "2"],
        env=variables,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert "rover on robot, 9 nodes" in result.stderr
    assert "up in " in result.stderr
