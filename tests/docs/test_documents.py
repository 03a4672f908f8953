"""The claim that what the documents say can be done as they say it, command by command."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from lodeline.loading import shipped
from tests.docs.documents import DOCUMENTS, ELSEWHERE, LANGUAGES, Block, anchors, blocks, links
from tests.support.live import ROOT, Up, environment

KEPT = ("nodes", "examples", "proto", "tests/data/recordings", "pipeline.yaml")
SHELL = ("sh", "console")
WITH_COMMANDS = [name for name in DOCUMENTS if any(b.language in SHELL for b in blocks(name))]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with what the commands name."""
    for name in KEPT:
        target = tmp_path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target)
    return tmp_path


def run(line: str, folder: Path, base: Path) -> subprocess.CompletedProcess[str]:
    """A line as a user would type it, with the environment's programs on the path."""
    # The project's own targets need the checkout with its environment.
    place = ROOT if line.startswith("make ") else folder
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-c", line],
        cwd=place,
        env={**environment(base), "PATH": path, "BROWSER": "true"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def parses(line: str) -> str:
    """What is wrong with a `lodeline` command that cannot be run here, "" if nothing."""
    words = shlex.split(line)
    if words[:2] == ["lodeline", "bench"] or words[0] != "lodeline":
        return ""
    file = shipped("tools") / f"{words[1]}.py"
    if not file.exists():
        return f"no verb {words[1]}"
    spec = importlib.util.spec_from_file_location(f"documented_{words[1]}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    try:
        module.parser().parse_args(words[2:])
    except SystemExit as stop:
        return f"usage error {stop.code}" if stop.code else ""
    return ""


def do(block: Block, folder: Path, base: Path) -> Iterator[str]:
    """Do what a block says; what went wrong."""
    kind, _, rest = block.order.partition(" ")
    if kind in ("file", "append"):
        with (folder / rest).open("a" if kind == "append" else "w") as stream:
            stream.write(block.text)
    elif block.language in SHELL:
        wanted = int(rest) if kind == "exits" else 0
        for line in block.commands:
            if block.order.startswith(("on ", "as root")):
                yield from filter(None, [parses(line)])
                continue
            if line.startswith("make test"):
                continue  # this is it
            done = run(line, folder, base)
            if done.returncode != wanted:
                yield f"`{line}` exits {done.returncode}: {done.stdout[-500:]}{done.stderr[-1500:]}"


@pytest.mark.parametrize("document", WITH_COMMANDS)
def test_every_command_does_what_is_said(document: str, checkout: Path, short_folder: Path) -> None:
    wrong = []
    with ExitStack() as running:
        up: Up | None = None
        for block in blocks(document):
            if block.order.startswith("while it runs") and up is None:
                file = block.order.removeprefix("while it runs").strip() or "pipeline.yaml"
                up = running.enter_context(Up(checkout / file, base=short_folder))
            elif up is not None and not block.order.startswith("while it runs"):
                running.close()
                up = None
            wrong += [
                f"{document}:{block.line}: {text}" for text in do(block, checkout, short_folder)
            ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_blocks_are_of_a_known_kind(document: str) -> None:
    assert {block.language for block in blocks(document)} <= {*LANGUAGES}


@pytest.mark.parametrize("document", [*DOCUMENTS, *ELSEWHERE, "proto/README.md"])
def test_links_lead_somewhere(document: str) -> None:
    dead = [
        f"{path}#{anchor}"
        for path, anchor in links(document)
        if not path.exists() or (anchor and anchor not in anchors(path))
    ]
    assert not dead
