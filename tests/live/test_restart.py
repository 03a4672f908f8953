"""Claims about a restart that somebody asks for."""

from __future__ import annotations

from pathlib import Path

from tests.support.live import Up, eventually, lodeline

FRAGILE = """
import sys
from pathlib import Path
from dataclasses import dataclass
from typing import Annotated
from lodeline.node import Driver, Output
from lodeline_msgs import WheelTicks


@dataclass(frozen=True, slots=True)
class Params:
    rate: Annotated[float, "Hz"] = 50.0


class Fragile(Driver[Params]):
    wheels = Output(WheelTicks)

    def setup(self) -> None:
        if not Path(__file__).with_name("mended").exists():
            print("not mended yet", file=sys.stderr)
            sys.exit(78)

    def tick(self, stamp: int) -> None:
        self.wheels.send(WheelTicks(stamp, 0, 0))


if __name__ == "__main__":
    from lodeline.process import run

    run(Fragile)
"""
PIPELINE = """
name: mend
nodes:
  fragile: {run: fragile.py, outputs: {wheels: wheels}}
  odometry: {run: nodes/odometry.py, inputs: {wheels: wheels}, outputs: {odom: odom}}
"""


def test_a_node_that_was_given_up_starts_again_when_it_is_mended(tmp_path: Path) -> None:
    (tmp_path / "fragile.py").write_text(FRAGILE)
    (tmp_path / "mend.yaml").write_text(PIPELINE)
    with Up(tmp_path / "mend.yaml") as up:
        assert eventually(lambda: up.ps()["fragile"]["state"] == "failed")
        (tmp_path / "mended").touch()
        result = up.call("restart", "fragile")
        assert (result.returncode, result.stdout) == (0, "fragile: restarting\n")
        assert eventually(lambda: up.ps()["fragile"]["state"] == "running")
        assert up.call("topic", "echo", "odom", "-n", "1", "--timeout", "10").returncode == 0
        before = up.ps()
        assert up.call("restart", "odometry").returncode == 0
        assert eventually(
            lambda: up.ps()["odometry"]["pid"] not in (None, before["odometry"]["pid"])
        )
        after = up.ps()
        assert after["odometry"]["restarts"] == 1
        assert after["fragile"]["pid"] == before["fragile"]["pid"]
        assert up.says("RESTART odometry: asked for")
        wrong = up.call("restart", "odometri")
        assert wrong.returncode == 4
        assert "did you mean 'odometry'?" in wrong.stderr


def test_without_a_pipeline_there_is_nothing_to_restart(short_folder: Path) -> None:
    assert lodeline("restart", "ekf", run=short_folder).returncode == 4
