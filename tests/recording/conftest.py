"""A robot of the magnet lab that exists on paper alone, and the pipeline that locates it."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lodeline.loading import load_node, shipped
from lodeline.pipeline.edge import Edge
from lodeline.pipeline.model import NodeSpec, Pipeline

TURN = 360 / (2 * math.pi * 0.0215)  # counts per metre of a wheel's way
REACH = 0.0085  # a magnet closes a reed within this


def drive(rows: int, start: float = 100.0) -> list[tuple[float, float, float, str]]:
    """True x, y, yaw and the text row at 20 Hz: at rest, straight on, a bow to the left, at rest.

    Both wheels are 1 % smaller than believed, so that plain odometry drifts.
    """
    x = y = yaw = left = right = 0.0
    made = []
    for i in range(rows):
        v = 0.06 if 5 <= i < rows - 5 else 0.0
        w = 0.15 if v and i > rows // 2 else 0.0
        made.append((x, y, yaw, _text_row(i, start, x, y, yaw, left, right)))
        yaw += 0.05 * w
        x += 0.05 * v * math.cos(yaw)
        y += 0.05 * v * math.sin(yaw)
        left += 0.05 * (v - 0.056 * w) * 1.01
        right += 0.05 * (v + 0.056 * w)
    return made


def _text_row(
    i: int, start: float, x: float, y: float, yaw: float, left: float, right: float
) -> str:
    byte = 255
    for reed in range(8):
        offset = 0.010 * (reed - 3.5)
        bx = x + 0.080 * math.cos(yaw) - offset * math.sin(yaw)
        by = y + 0.080 * math.sin(yaw) + offset * math.cos(yaw)
        if math.hypot(bx - 0.055 * round(bx / 0.055), by - 0.055 * round(by / 0.055)) < REACH:
            byte &= ~(1 << reed)
    counts = f"{round(left * TURN)}.000000 {round(right * TURN)}.000000"
    return f"{counts} {byte}.000000 {start + 0.05 * i:.6f}" + " 0.000000" * 11


@pytest.fixture
def lab_text(tmp_path: Path) -> Path:
    """A text file of 400 rows, 20 s."""
    file = tmp_path / "run.txt"
    file.write_text("\n".join(row for *_, row in drive(400)) + "\n")
    return file


SpecMaker = Callable[..., NodeSpec]


@pytest.fixture
def make_spec() -> SpecMaker:
    """A node of the pipeline `robot`, wired by short keys, with default parameters."""

    def make(
        name: str, kind: type[Any], inputs: dict[str, str], outputs: dict[str, str]
    ) -> NodeSpec:
        return NodeSpec(
            name=name,
            run=Path(f"{name}.py"),
            host="robot",
            process=name,
            type=kind,
            params=kind.params_type()(),
            inputs={port: Edge(f"robot/{key}", 64, 0.5) for port, key in inputs.items()},
            outputs={port: f"robot/{key}" for port, key in outputs.items()},
            values={},
            sends={port: kind.outputs()[port].message for port in outputs},
            rates={},
            restart="limited",
            required=False,
            priority=None,
            cpu=None,
        )

    return make


PipelineMaker = Callable[..., Pipeline]


@pytest.fixture
def make_pipeline() -> PipelineMaker:
    """A pipeline called `robot` of the given nodes."""

    def make(*specs: NodeSpec) -> Pipeline:
        return Pipeline("robot", Path("robot.yaml"), "0123", "recording", {}, specs, {})

    return make


@pytest.fixture
def lab_pipeline(make_spec: SpecMaker, make_pipeline: PipelineMaker) -> Pipeline:
    """Odometry, magnets and EKF with default parameters."""

    def kind(name: str) -> type[Any]:
        return load_node(shipped("nodes") / f"{name}.py")

    return make_pipeline(
        make_spec("odometry", kind("odometry"), {"wheels": "wheels"}, {"odom": "odom"}),
        make_spec("magnets", kind("magnets"), {"reeds": "reeds"}, {"magnets": "magnets"}),
        make_spec("ekf", kind("ekf"), {"odom": "odom", "magnets": "magnets"}, {"pose": "pose"}),
    )


def load_tool(name: str) -> Any:
    """A program of tools/ as a module: it has `main(argv)`."""
    file = shipped("tools") / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"tool_{name}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def bag() -> Callable[[list[str]], int]:
    """`lodeline bag` in this process."""
    main: Callable[[list[str]], int] = load_tool("bag").main
    return main


@pytest.fixture
def replay_tool() -> Callable[[list[str]], int]:
    """`lodeline replay` in this process."""
    main: Callable[[list[str]], int] = load_tool("replay").main
    return main
