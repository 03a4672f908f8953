"""What is typed wrong, or cannot be done, is answered in words and by an exit code."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from lodeline import cli
from lodeline.terminal.samples import sample_text
from lodeline_msgs import Odometry, field_specs, pack
from tests.support.samples import SAMPLES

ROOT = Path(__file__).resolve().parents[2]
Capture = pytest.CaptureFixture[str]


def said(capsys: Capture, *words: str) -> tuple[int, str]:
    """Exit code and what stands on standard error, its last line."""
    try:
        code = cli.main([str(word) for word in words])
    except SystemExit as end:  # argparse
        code = int(end.code or 0)
    return code, capsys.readouterr().err.strip().rpartition("\n")[2]


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["../evil"], "'../evil' must start with a-z and hold only a-z, 0-9, _, -"),
        (["robot", "10.0.0.999"], "'10.0.0.999' is neither an IP address nor the name"),
        (["robot", "10.0.0.1:7447"], "(a port does not belong here)"),
        (["robot", "--days", "-3"], "-3 is not above 0"),
    ],
)
def test_keys_refuses_what_is_no_host_no_address_and_no_time(
    words: list[str], answer: str, tmp_path: Path, capsys: Capture
) -> None:
    pytest.importorskip("cryptography")
    keys = tmp_path / "keys"
    assert cli.main(["keys", "init", "--folder", str(keys)]) == 0
    code, text = said(capsys, "keys", "add", "--folder", str(keys), *words)
    assert code == 2
    assert answer in text
    assert sorted(file.name for file in tmp_path.rglob("*.pem")) == ["ca.pem"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, capsys: Capture) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    below, recording = blocked / "x", ROOT / "tests/data/recordings/rover.mcap"
    for words in (
        ("keys", "init", "--folder", below),
        ("new", below, "--robot", "scuttle"),
        ("plot", recording, "--png", below),
    ):
        code, text = said(capsys, *map(str, words))
        assert code == 1, words
        assert text.endswith(f"{below}: Not a directory"), words


@pytest.mark.parametrize("verb", ["logs", "topic echo pose"])
def test_a_count_below_zero_is_refused_in_words(verb: str, capsys: Capture) -> None:
    code, text = said(capsys, *verb.split(), "-n", "-3")
    assert code == 2
    assert text.endswith(": -3 is below 0")


@pytest.mark.parametrize(
    ("words", "usage", "why"),
    [
        ("topic hz --seconds 3", "lodeline topic hz", "unrecognized arguments: --seconds"),
        ("topic list pose", "lodeline topic list", "unrecognized arguments: pose"),
        ("bag info a.mcap --jsn", "lodeline bag info", "--jsn, did you mean --json?"),
        ("keys init robot", "lodeline keys init", "unrecognized arguments: robot"),
    ],
)
def test_what_a_verb_below_another_does_not_take_is_told_by_its_own_usage(
    capsys: Capture, words: str, usage: str, why: str
) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(words.split())
    err = capsys.readouterr().err
    assert end.value.code == 2
    assert err.startswith(f"usage: {usage} ")
    assert err.rstrip().endswith(why)


def test_the_exercises_are_listed_as_json(capsys: Capture) -> None:
    assert cli.main(["grade", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == {"odometry", "heading", "measurement"}


def test_a_full_disk_behind_the_output_is_named() -> None:
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [sys.executable, "-P", "-m", "lodeline", "graph"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (result.returncode, result.stderr) == (1, "lodeline: output: No space left on device\n")


@pytest.mark.parametrize("closed", ["1", "2"])
def test_an_output_that_the_shell_closed_changes_no_exit_code(closed: str) -> None:
    command = f'"{sys.executable}" -P -m lodeline check {closed}>&-'
    result = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")


def test_echo_shows_units_where_there_are_some() -> None:
    sample = next(each for each in SAMPLES if isinstance(each, Odometry))
    lines = sample_text(pack(sample), field_specs(Odometry), as_json=False).splitlines()
    assert lines[0].startswith("stamp: ")
    assert lines[0].endswith(" s)")
    assert f"seq: {sample.seq}" in lines
    assert f"resets: {sample.resets}" in lines
    assert f"v: {sample.v:.6g} m/s" in lines
