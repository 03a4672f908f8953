"""The command `lodeline` and its verb `check`: what they print where, and how they exit."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lodeline import cli
from lodeline.loading import shipped
from tests.support.live import ROOT

GOOD = Path(__file__).parents[1] / "data/rig.yaml"


def lodeline(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lodeline", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=30)


def test_fine_file_is_one_line_and_exit_0() -> None:
    done = lodeline("check", GOOD)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{GOOD}: 3 nodes, 3 keys, 2 hosts: fine\n"


def test_broken_file_is_a_line_a_fault_and_exit_3(tmp_path: Path) -> None:
    text = GOOD.read_text().replace("clock: host", "clok: host").replace("cpu: 1", "cpu: one")
    (tmp_path / "nodes").symlink_to(GOOD.parent / "nodes")
    (tmp_path / "pipeline.yaml").write_text(text)
    done = lodeline("check", cwd=tmp_path)
    assert done.returncode == 3
    assert done.stdout.splitlines() == [
        "pipeline.yaml:2:1: unknown key 'clok' in the file, did you mean 'clock'?",
        'pipeline.yaml:23:10: cpu must be a whole number, got the text "one"',
    ]
    assert done.stderr == "2 faults\n"


def test_check_without_a_file_takes_the_shipped_pipeline(tmp_path: Path) -> None:
    done = lodeline("check", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.startswith(f"{shipped('pipeline.yaml')}: ")


def test_check_by_the_name_of_a_profile_from_anywhere(tmp_path: Path) -> None:
    assert lodeline("check", "magnet-lab", cwd=tmp_path).returncode == 0
    done = lodeline("check", "magnet-lob", cwd=tmp_path)
    assert done.returncode == 3
    text = "is neither a file nor a profile, did you mean 'magnet-lab'?"
    assert done.stdout == f"magnet-lob: {text}\n"


def test_overrides_from_the_command_line() -> None:
    assert lodeline("check", GOOD, "--set", "smoother.window=1").returncode == 0
    done = lodeline("check", GOOD, "--set", "smoother.window=x", "--set", "source.sed=1")
    assert done.returncode == 3
    assert done.stdout.splitlines() == [
        '--set smoother.window=x: window must be a number [s], got the text "x"',
        "--set source.sed=1: unknown parameter 'sed', did you mean 'seed'?",
    ]


def test_json_of_a_fine_and_of_a_broken_file() -> None:
    fine = json.loads(lodeline("check", GOOD, "--json").stdout)
    assert fine["fine"] and fine["faults"] == [] and fine["nodes"][0] == "source"
    assert fine["keys"]["rig/speed/mean"] == "Twist"
    done = lodeline("check", GOOD, "--json", "--set", "source.sed=1")
    assert done.returncode == 3
    (fault,) = json.loads(done.stdout)["faults"]
    assert (fault["file"], fault["line"]) == ("--set source.sed=1", 0)


def test_warning_goes_to_stderr_and_is_no_failure(tmp_path: Path) -> None:
    (tmp_path / "nodes").symlink_to(GOOD.parent / "nodes")
    file = tmp_path / "open.yaml"
    file.write_text(GOOD.read_text().replace("127.0.0.1", "0.0.0.0"))
    done = lodeline("check", file)
    assert done.returncode == 0 and done.stdout.endswith("fine\n")
    assert done.stderr.startswith(f"warning: {file}:4:19: host 'robot' listens on 0.0.0.0 without")


def test_check_tells_within_the_time_of_a_blink() -> None:
    started = os.times()
    assert lodeline("check").returncode == 0
    ended = os.times()
    # CPU of the child, so that neighbours on this machine do not count.
    spent = ended.children_user + ended.children_system
    assert spent - started.children_user - started.children_system < 0.6


def test_check_loads_neither_transport_nor_array_library() -> None:
    code = (
        "import sys; from lodeline.cli import main; code = main(['check']);"
        "heavy = {'zenoh', 'numpy', 'filterpy', 'rich', 'asyncio'} & set(sys.modules);"
        "sys.exit(f'loaded {heavy}' if heavy else code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (0, "")


def test_help_lists_every_verb_by_its_first_line() -> None:
    done = lodeline("--help")
    assert (done.returncode, done.stderr) == (0, "")
    for file in shipped("tools").glob("*.py"):
        first = file.read_text().split("\n")[0].strip('"')
        assert any(line.split() == [file.stem, *first.split()] for line in done.stdout.split("\n"))


def test_usage_errors_exit_2_and_say_the_nearest_verb() -> None:
    done = lodeline("chekc")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "lodeline: unknown verb 'chekc', did you mean 'check'?\n"
    assert lodeline().returncode == 2
    assert lodeline("check", "--no-such-option").returncode == 2


def test_version_is_one_line() -> None:
    done = lodeline("--version")
    assert done.returncode == 0 and done.stdout.startswith("lodeline 0.")


def test_installed_script_is_the_same_command() -> None:
    script = Path(sys.executable).with_name("lodeline")
    if not script.exists():
        pytest.skip("lodeline is not installed as a script here")
    done = subprocess.run([script, "check", GOOD], capture_output=True, text=True, timeout=30)
    assert done.stdout == lodeline("check", GOOD).stdout


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_leaves_early_is_no_traceback(unbuffered: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "lodeline", "--help"],
        stdout=writing,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        timeout=30,
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, b"")


def verb(folder: Path, monkeypatch: pytest.MonkeyPatch, body: str) -> None:
    """Make `lodeline try` a program with that body."""
    (folder / "try.py").write_text(f'"""Try it."""\n\n\ndef main(argv):\n    {body}\n')
    monkeypatch.setattr(cli, "shipped", lambda _name: folder)


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("return 4", 4),
        ("return len(argv)", 2),
        ("raise KeyboardInterrupt", 130),
        (
            "from lodeline.pipeline.load import load; from pathlib import Path;"
            " load(Path('/nowhere.yaml'))",
            3,
        ),
    ],
)
def test_exit_code_of_a_verb(
    body: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    verb(tmp_path, monkeypatch, body)
    assert cli.main(["try", "a", "b"]) == code


def test_broken_socket_of_a_verb_is_not_taken_for_a_closed_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    verb(tmp_path, monkeypatch, "raise BrokenPipeError('socket')")
    with (tmp_path / "out").open("w") as out:
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", out)
        with pytest.raises(BrokenPipeError):
            cli.main(["try"])


def test_a_reader_that_leaves_a_verb_on_recordings_is_no_fault() -> None:
    bag = ROOT / "tests" / "data" / "recordings" / "rover.mcap"
    line = f"{sys.executable} -P -m lodeline compare {bag} {bag} --key truth --json | head -1"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("{\n", "")


def test_ctrl_c_during_a_hanging_import_exits_130(tmp_path: Path) -> None:
    ready = tmp_path / "ready"
    program = f"import time, pathlib\npathlib.Path({str(ready)!r}).touch()\ntime.sleep(60)\n"
    (tmp_path / "own.py").write_text(program)
    (tmp_path / "pipeline.yaml").write_text("name: rig\nnodes: {own: {run: own.py}}\n")
    check = subprocess.Popen(
        [sys.executable, "-m", "lodeline", "check"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 20
    while not ready.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    check.send_signal(signal.SIGINT)
    out, err = check.communicate(timeout=20)
    assert (check.returncode, out, err) == (130, b"", b"")
