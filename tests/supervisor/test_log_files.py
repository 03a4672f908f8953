"""Claims about log files: bounded, whole, kept over the end of a run, and never in the way."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from lodeline.supervisor.log_files import FILE_BYTES, FILES, LogFiles, append, read
from tests.support.live import Up, eventually, lodeline

WHEELS = Path(__file__).parents[1] / "faults" / "nodes" / "wheels.py"
LINES = [b"%06d " % number + b"x" * 992 + b"\n" for number in range(40_000)]


def test_a_node_that_never_stops_talking_takes_25_megabytes_and_its_newest_lines_stay(
    tmp_path: Path,
) -> None:
    for begin in range(0, len(LINES), 997):
        append(tmp_path / "noisy.log", LINES[begin : begin + 997])
    files = sorted(tmp_path.iterdir(), reverse=True)  # noisy.log.4 is the oldest
    assert [file.name for file in files] == [
        *(f"noisy.log.{number}" for number in range(FILES - 1, 0, -1)),
        "noisy.log",
    ]
    assert all(file.stat().st_size <= FILE_BYTES for file in files)
    kept = b"".join(file.read_bytes() for file in files).splitlines(keepends=True)
    assert kept == LINES[-len(kept) :]
    assert len(kept) > 4 * FILE_BYTES // 1000


@pytest.fixture
def full() -> Iterator[Path]:
    """A folder on a disk of 64 kB."""
    folder = Path(tempfile.mkdtemp(prefix="ll"))
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(command, check=False).returncode != 0:
        pytest.skip("mounting a small disk needs root")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)
    folder.rmdir()


def test_a_full_disk_is_named_once_costs_lines_only_and_is_got_over(full: Path) -> None:
    said: list[str] = []
    files = LogFiles(full, said.append)
    ballast = full / "ballast"
    ballast.write_bytes(bytes(60_000))
    for number in range(3):
        files.add("node", f"{number} " + "x" * 8000)
        assert eventually(lambda: bool(said))
    ballast.unlink()

    def goes_on() -> bool:
        files.add("node", "room again")
        return any(line["text"] == "room again" for line in read(full))

    assert eventually(goes_on)
    files.close()
    assert len(said) == 1
    assert said[0].startswith(f"LOG_FILES {full}: No space left on device")


def test_logs_of_a_pipeline_that_has_ended_are_read_from_its_files(tmp_path: Path) -> None:
    file = tmp_path / "ended.yaml"
    file.write_text(
        f"name: ended\nnodes:\n  wheels: {{run: {WHEELS}, outputs: {{wheels: wheels}}}}\n"
    )
    with tempfile.TemporaryDirectory(prefix="ll") as folder:
        base = Path(folder)
        assert lodeline("logs", run=base).returncode == 4
        with Up(file, base=base) as up:
            os.kill(up.ps()["wheels"]["pid"], 9)
            assert eventually(lambda: up.says("NODE_EXIT wheels: SIGKILL"))
        result = lodeline("logs", "--json", run=base)
        assert result.returncode == 0
        assert "ended does not run; from " in result.stderr
        lines = [json.loads(line) for line in result.stdout.splitlines()]
        shown = [line.partition("| ")[2].rstrip("\n") for line in up.log]
        assert [line["text"] for line in lines] == shown
        assert {line["host"] for line in lines} == {"robot"}
        assert all(abs(line["time"] - time.time()) < 300.0 for line in lines)
        newest = lodeline("logs", "wheels", "-n", "1", run=base).stdout
        assert "lodeline | NODE_EXIT wheels: SIGKILL" in newest
        assert len(newest.splitlines()) == 1
        wrong = lodeline("logs", "lodelin", run=base)
        assert wrong.returncode == 4
        assert "nothing about 'lodelin' there, did you mean 'lodeline'?" in wrong.stderr
