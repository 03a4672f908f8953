"""The claim that others need nothing of ours to read a recording: MCAP's own library for Node."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import asdict
from pathlib import Path

import pytest

from lodeline.recording.write import RecordingWriter, whole_file
from tests.support.samples import SAMPLES

PROGRAM = Path(__file__).with_name("javascript")


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reading program with its libraries beside it."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        pytest.skip("no node and npm here")
    folder = tmp_path_factory.mktemp("javascript")
    for file in PROGRAM.iterdir():
        shutil.copy(file, folder)
    command = [npm, "install", "--no-audit", "--no-fund", "--no-package-lock", "--ignore-scripts"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    if done.returncode:
        pytest.skip(f"npm cannot fetch MCAP's library: {done.stderr.strip()[-200:]}")
    return folder / "read.js"


def test_every_message_class_is_read_in_javascript_and_fits_its_schema(
    reader: Path, tmp_path: Path
) -> None:
    file = tmp_path / "run.mcap"
    kinds = {type(message).__name__: message for message in SAMPLES}
    with whole_file(file) as stream:
        writer = RecordingWriter(stream, {"pipeline": "rover"})
        for _ in range(200):  # several chunks
            for name, message in kinds.items():
                writer.write(name.lower(), message)
        writer.close()
    result = subprocess.run(
        ["node", str(reader), str(file)], capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 0, result.stderr
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(rows) == 200 * len(kinds)
    for key, schema, encodings, log_time, number, values in rows:
        message = kinds[schema]
        assert (key, encodings) == (schema.lower(), "jsonschema msgpack")
        assert (int(log_time), number) == (message.stamp, message.seq)
        sent = json.loads(json.dumps(asdict(message)))
        # JavaScript's own JSON has doubles only, and a stamp is longer than their 53 bits.
        assert float(values.pop("stamp")) == float(sent.pop("stamp"))
        assert values == sent
    assert {schema for _, schema, *_ in rows} == set(kinds)
