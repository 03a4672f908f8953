"""Claims about what other programs are told of a message."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from pathlib import Path

import msgpack
import pytest
from jsonschema import Draft202012Validator

from lodeline_msgs import (
    MESSAGES,
    MagnetDetection,
    Message,
    NodeStatus,
    PoseEstimate,
    columns,
    from_row,
    json_schema,
    pack,
    row,
    stamp_text,
    unit_table,
)
from tests.support.samples import SAMPLES, STAMP, name_of

README = Path(__file__).parents[2] / "proto" / "README.md"


@pytest.mark.parametrize("sample", SAMPLES, ids=name_of)
def test_a_packed_sample_obeys_its_json_schema(sample: Message) -> None:
    schema = json.loads(json.dumps(json_schema(type(sample))))
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    values = msgpack.unpackb(pack(sample))
    validator.validate(values)
    assert not validator.is_valid(
        {name: value for name, value in values.items() if name != "stamp"}
    )
    assert not validator.is_valid(dict(values, stamp="now"))


def test_a_pose_table_begins_with_stamp_x_y_yaw_and_ends_with_seq() -> None:
    names = columns(PoseEstimate)
    assert names[:5] == ["stamp", "x", "y", "yaw", "covariance_xx"]
    assert names[-1] == "seq"


@pytest.mark.parametrize("sample", SAMPLES, ids=name_of)
def test_a_table_row_has_a_cell_for_each_column(sample: Message) -> None:
    line = io.StringIO()
    csv.writer(line).writerow(row(sample))
    cells = next(csv.reader([line.getvalue()]))
    assert len(cells) == len(columns(type(sample)))
    assert cells[0] == "1700000000.123456789"
    assert cells[-1] == str(sample.seq)
    assert from_row(type(sample), cells) == sample


def test_causes_of_several_words_survive_a_table() -> None:
    status = next(each for each in SAMPLES if isinstance(each, NodeStatus))
    rejected = {"time stands still": 3, "gate": 2, "stamp not newer": 1}
    told = dataclasses.replace(status, rejected=rejected)
    assert from_row(NodeStatus, row(told)) == told


def test_floats_in_a_row_lose_no_bit() -> None:
    assert row(MagnetDetection(STAMP, (0.1 + 0.2, 1 / 3)))[1] == f"{0.1 + 0.2!r} {1 / 3!r}"


@pytest.mark.parametrize(
    ("stamp", "text"),
    [(0, "0.000000000"), (699_890_991_000, "699.890991000"), (-1, "-0.000000001")],
)
def test_stamps_are_written_as_exact_seconds(stamp: int, text: str) -> None:
    assert stamp_text(stamp) == text


def test_the_readme_holds_the_unit_table() -> None:
    table = "\n".join(unit_table())
    assert table in README.read_text(), "replace the table in proto/README.md by unit_table()"
    assert all(f"| {name} |" in table for name in MESSAGES)
