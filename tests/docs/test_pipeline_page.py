"""The claim that the pages about pipeline files and nodes are complete."""

from __future__ import annotations

from pathlib import Path

from lodeline.pipeline.draft import FILE_KEYS, NODE_KEYS
from lodeline.pipeline.load import load
from lodeline.terminal.node_manual import node_manual
from tests.docs.documents import blocks
from tests.support.live import ROOT

PAGE = ROOT / "docs" / "pipeline-file.md"


def test_the_page_of_nodes_is_up_to_date() -> None:
    assert (ROOT / "docs" / "nodes.md").read_text() == node_manual(), (
        "write it anew: python -m lodeline.terminal.node_manual > docs/nodes.md"
    )


def test_every_key_of_a_pipeline_file_is_on_its_page() -> None:
    (example,) = blocks("docs/pipeline-file.md")
    written = {line.split(":")[0] for line in example.text.splitlines() if line[0] != " "}
    assert written == set(FILE_KEYS)
    assert {key for key in NODE_KEYS if f"| `{key}` |" in PAGE.read_text()} == set(NODE_KEYS)


def test_the_example_is_read_as_a_pipeline_file(tmp_path: Path) -> None:
    (example,) = blocks("docs/pipeline-file.md")
    # The nodes that send what it reads are left out of the example.
    text = example.text.replace("external:\n", "external:\n  odom: Odometry\n", 1)
    text = text.replace("external:\n", "external:\n  magnets: MagnetDetection\n", 1)
    text = text.replace("link_rate: {imu/data_raw: 20}", "link_rate: {pose: 20}")
    (tmp_path / "pipeline.yaml").write_text(text)
    assert load(tmp_path / "pipeline.yaml").node("ekf").rates == {"pose": 100.0}
