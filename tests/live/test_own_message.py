"""A message class that stands in a node's own file is known to the tools, live and recorded."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.live import Up, lodeline

pytestmark = pytest.mark.live

NODE = '''
from __future__ import annotations
from dataclasses import dataclass
from typing import Annotated
from lodeline.node import Driver, Output
from lodeline_msgs import Message, Unit, message

@message
class Battery(Message):
    """What is left."""
    voltage: Annotated[float, Unit("V", "of the whole pack")]

@dataclass(frozen=True, slots=True)
class MeterParams:
    rate: Annotated[float, "Hz"] = 50.0

class Meter(Driver[MeterParams]):
    battery = Output(Battery)

    def tick(self, stamp: int) -> None:
        self.battery.send(Battery(stamp, voltage=8.25))

if __name__ == "__main__":
    from lodeline.process import run
    run(Meter)
'''
PIPELINE = "name: power\nnodes:\n  meter: {run: meter.py, outputs: {battery: battery}}\n"


def test_a_class_of_a_nodes_own_file_is_shown_recorded_and_exported(tmp_path: Path) -> None:
    (tmp_path / "meter.py").write_text(NODE)
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    bag = str(tmp_path / "power.mcap")
    with Up(tmp_path / "pipeline.yaml") as up:
        assert "voltage  V     of the whole pack" in up.call("topic", "info", "battery").stdout
        assert "voltage: 8.25 V" in up.call("topic", "echo", "battery", "-n", "1").stdout
        recorded = up.call("bag", "record", "battery", "-o", bag, "--seconds", "0.5")
        assert recorded.returncode == 0, recorded.stderr
    exported = lodeline("bag", "export", bag, "--csv", str(tmp_path), run=tmp_path)
    assert exported.returncode == 0, exported.stderr
    header, row, *_ = (tmp_path / "battery.csv").read_text().splitlines()
    assert header == "stamp,voltage,seq"
    assert row.split(",")[1] == "8.25"
    assert (
        "voltage: 8.25 V" in lodeline("topic", "echo", "battery", "--bag", bag, run=tmp_path).stdout
    )
