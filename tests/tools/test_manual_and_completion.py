"""Claims about what is made from the tools' parsers: the manual, and completion in shells."""

from __future__ import annotations

import argparse
import os
import pty
import select
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from lodeline.terminal.manual import manual
from lodeline.terminal.verbs import parsers
from tests.support.live import ROOT, lodeline


def test_the_manual_is_up_to_date() -> None:
    assert (ROOT / "docs" / "cli.md").read_text() == manual(), (
        "write it anew: python -m lodeline.terminal.manual > docs/cli.md"
    )


def each(name: str, parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.Action]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for verb, below in action.choices.items():
                yield from each(f"{name} {verb}", below)
        else:
            yield name, action


def test_the_manual_has_every_verb_and_every_option() -> None:
    text = manual()
    for verb, parser in parsers().items():
        for name, action in each(f"lodeline {verb}", parser):
            section = text.partition(f"# {name}\n")[2].partition("\n#")[0]
            assert section, name
            for option in action.option_strings:
                assert option in ("-h", "--help") or f"`{option}`" in section, f"{name} {option}"


def test_every_option_says_what_it_is_for() -> None:
    dumb = [
        f"{name} {action.option_strings[0]}"
        for verb, parser in parsers().items()
        for name, action in each(verb, parser)
        if action.option_strings and not action.help
    ]
    assert dumb == []


BASH = """\
source {script}
words=({words} '{last}')
COMP_WORDS=("${{words[@]}}"); COMP_CWORD=$(( ${{#words[@]}} - 1 ))
COMP_LINE="${{words[*]}}"; COMP_POINT=${{#COMP_LINE}}
_shtab_lodeline
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("completion")
    made = lodeline("completion", "bash", run=folder)
    assert made.returncode == 0, made.stderr
    file = folder / "lodeline.bash"
    file.write_text(made.stdout)
    return file


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("lodeline grap", {"graph"}),
        ("lodeline topic d", {"delay"}),
        ("lodeline topic echo --ti", {"--timeout"}),
        ("lodeline graph --m", {"--mermaid"}),
        ("lodeline completion ", {"bash", "zsh"}),
        ("lodeline bag import --format ", {"csv", "lecture-imu", "lecture-wheels", "magnet-lab"}),
    ],
)
def test_bash_completes(script: Path, line: str, expected: set[str]) -> None:
    *words, last = line.split(" ")
    order = BASH.format(script=script, words=" ".join(words), last=last)
    result = subprocess.run(["bash", "-c", order], capture_output=True, text=True, timeout=10.0)
    assert result.returncode == 0, result.stderr
    assert set(result.stdout.split()) == expected


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_names_of_recordings(script: Path, tmp_path: Path) -> None:
    (tmp_path / "monday.mcap").touch()
    words = f"lodeline bag info {tmp_path}/mon"
    *before, last = words.split(" ")
    order = BASH.format(script=script, words=" ".join(before), last=last)
    result = subprocess.run(["bash", "-c", order], capture_output=True, text=True, timeout=10.0)
    assert f"{tmp_path}/monday.mcap" in result.stdout.split()


@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh here")
def test_zsh_completes_on_tab(tmp_path: Path) -> None:
    (tmp_path / "_lodeline").write_text(lodeline("completion", "zsh", run=tmp_path).stdout)
    ours, theirs = pty.openpty()
    shell = subprocess.Popen(
        ["zsh", "-fi"],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "dumb"},
    )
    os.close(theirs)

    def types(text: str, awaited: str) -> None:
        """Keys that a user presses, and what the shell shows then."""
        os.write(ours, text.encode())
        shown = ""
        while awaited not in shown:
            assert select.select([ours], [], [], 10.0)[0], f"{text!r}: {awaited!r} not in {shown!r}"
            shown += os.read(ours, 4096).decode()

    clear = "\x15"
    try:
        types(f"fpath=({tmp_path} $fpath); autoload -Uz compinit; compinit -u -D\n", "\n")
        types("print $((40 + 2))\n", "42")
        types("lodeline ba\t", "lodeline bag ")
        types(f"{clear}lodeline bag rec\t", "lodeline bag reco")
        types(f"{clear}lodeline graph --m\t", "lodeline graph --mermaid ")
        types(f"{clear}lodeline completion \t", "bash  zsh")
    finally:
        shell.kill()
        shell.wait()
        os.close(ours)
