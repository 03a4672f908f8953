"""Claims about `lodeline graph`: every wire is in every picture, and pictures can be read."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from lodeline.pipeline.load import load
from lodeline.pipeline.model import Pipeline
from lodeline.terminal.drawing import BOX_HIGH, BOX_WIDE, as_dot, as_mermaid, as_svg, as_text
from lodeline.terminal.wires import OUTSIDE, layers_of, wires_of
from tests.support.live import ROOT, lodeline

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module", params=["pipeline.yaml", "tests/data/rig.yaml"])
def pipeline(request: pytest.FixtureRequest) -> Pipeline:
    return load(ROOT / request.param)


def edges(pipeline: Pipeline) -> set[tuple[str, str, str]]:
    """Source, key and target of each edge, by the model alone."""
    sources = {key: spec.name for spec in pipeline.nodes for key in spec.outputs.values()}
    return {
        (sources.get(edge.key, OUTSIDE), edge.key.partition("/")[2], spec.name)
        for spec in pipeline.nodes
        for edge in spec.inputs.values()
    }


def test_wires_are_the_edges_of_the_file(pipeline: Pipeline) -> None:
    wires = wires_of(pipeline)
    assert {(w.source, w.key, w.target) for w in wires if w.target} == edges(pipeline)
    assert {wire.key for wire in wires} == {key.partition("/")[2] for key in pipeline.key_types()}


def test_data_flow_from_left_to_right(pipeline: Pipeline) -> None:
    layers = layers_of(pipeline, wires_of(pipeline))
    column = {name: place for place, layer in enumerate(layers) for name in layer}
    assert sorted(column) == sorted(
        {spec.name for spec in pipeline.nodes} | {source for source, _, _ in edges(pipeline)}
    )
    assert all(column[source] < column[target] for source, _, target in edges(pipeline))


def test_text_names_each_key_once_with_all_its_readers(pipeline: Pipeline) -> None:
    lines = [line for line in as_text(pipeline).splitlines() if line.startswith("  ")]
    for _source, key, target in edges(pipeline):
        (line,) = [line for line in lines if line.split()[:1] == [key]]
        assert f"{target} (newest" in line


def test_mermaid_and_dot_have_every_edge(pipeline: Pipeline) -> None:
    mermaid, dot = as_mermaid(pipeline), as_dot(pipeline)
    for source, key, target in edges(pipeline):
        start = "outside([outside])" if source == OUTSIDE else f"node_{source}"
        assert f'{start} -->|"{key}"| node_{target}' in mermaid
        assert f'"{source}" -> "{target}" [label="{key}"];' in dot
    assert mermaid.count("subgraph") == mermaid.count("  end")
    assert dot.count("{") == dot.count("}")


def test_svg_is_whole_and_its_boxes_do_not_overlap(pipeline: Pipeline) -> None:
    root = ET.fromstring(as_svg(pipeline))
    boxes = [(float(box.get("x", "")), float(box.get("y", ""))) for box in root.iter(f"{SVG}rect")]
    _, _, wide, high = map(float, root.get("viewBox", "").split())
    for place, (x, y) in enumerate(boxes):
        assert 0 <= x <= wide - BOX_WIDE
        assert 0 <= y <= high - BOX_HIGH
        for other_x, other_y in boxes[:place]:
            assert abs(x - other_x) >= BOX_WIDE or abs(y - other_y) >= BOX_HIGH
    texts = {text.text for text in root.iter(f"{SVG}text")}
    for source, key, target in edges(pipeline):
        assert {source, key, target} <= texts
    wires = [
        [float(number) for number in re.findall(r"-?\d+", path.get("d", ""))]
        for path in root.iter(f"{SVG}path")
    ]
    assert len(wires) == len({(source, target) for source, _, target in edges(pipeline)})
    assert all((x - BOX_WIDE, y - BOX_HIGH / 2) in boxes for x, y, *_ in wires)
    assert all((x, y - BOX_HIGH / 2) in boxes for *_, x, y in wires)


def test_graph_reads_a_file_that_does_not_run(tmp_path: Path) -> None:
    drawn = lodeline("graph", str(ROOT / "pipeline.yaml"), "--json", run=tmp_path)
    assert drawn.returncode == 0
    found = {(wire["source"], wire["key"], wire["target"]) for wire in json.loads(drawn.stdout)}
    assert ("odometry", "odom", "ekf") in found
    broken = tmp_path / "broken.yaml"
    broken.write_text("name: x\nnodes: {a: {run: nowhere.py}}\n")
    result = lodeline("graph", str(broken), run=tmp_path)
    assert result.returncode == 3
    assert "nowhere.py" in result.stderr
