"""Files made to hurt are refused by name within half a second and a little memory."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lodeline.pipeline.document import MAX_BYTES, MAX_DEPTH, MAX_ITEMS, MAX_TEXT
from lodeline.pipeline.load import PipelineError, load

FILL = MAX_BYTES - 8
DEEP = f"nested deeper than {MAX_DEPTH}"
MANY = f"more than {MAX_ITEMS} items"
LONG = f"a text of more than {MAX_TEXT} characters"
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in zip("abcdefgh", "bcdefghi", strict=True)
)
MERGE = "x0: &x0 {a: 1}\n" + "".join(
    f"x{i}: &x{i} {{<<: [{', '.join([f'*x{i - 1}'] * 10)}]}}\n" for i in range(1, 8)
)

FILES = {
    "alias bomb": (BOMB, "aliases (*) are not read"),
    "merge bomb": (MERGE, "merge keys (<<) are not read"),
    "brackets": ("[" * FILL, DEEP),
    "braces": ("{a: " * (FILL // 4), DEEP),
    "brackets by line": ("[\n" * (FILL // 2), DEEP),
    "dashes": ("- " * (FILL // 2), DEEP),
    "question marks": ("? " * (FILL // 2), "a key must be a word"),
    "steps": ("".join(f"{' ' * i}a:\n" for i in range(300)), DEEP),
    "many keys": ("".join(f"k{i}:\n" for i in range(FILL // 8)), MANY),
    "many items": (f"a: [{'1,' * (FILL // 2 - 4)}1]", MANY),
    "the same key for ever": ("a: 1\n" * (FILL // 5), MANY),
    "directives": ("%a\n" * (FILL // 3), "no YAML"),
    "digits": (f"name: {'9' * (FILL - 8)}", LONG),
    "hexadecimal digits": (f"name: 0x{'f' * (FILL - 8)}", LONG),
    "one long word": (f"name: {'x' * (FILL - 8)}", LONG),
    "many words": (f"name: {'x ' * (FILL // 2 - 4)}", LONG),
    "a folded text": ("name: >\n" + " x\n\n" * (FILL // 4 - 4), LONG),
    "blank lines": ("\n" * FILL, "is empty"),
    "comments": ("#\n" * (FILL // 2), "is empty"),
    "quotes": ("'" * FILL, LONG),
    "a long key": (f"{'k' * 900}: 1\n{'k' * 1010}: 1\n", LONG),
    "too large": ("#" * (MAX_BYTES + 1), f"is larger than {MAX_BYTES // 1024} KiB"),
    "far too large": ("", f"is larger than {MAX_BYTES // 1024} KiB"),
}


def write(folder: Path, case: str) -> Path:
    file = folder / "pipeline.yaml"
    file.write_text(FILES[case][0])
    if case == "far too large":
        os.truncate(file, 10**9)
    return file


@pytest.mark.parametrize("case", FILES)
def test_hostile_file_is_refused_at_once(case: str, tmp_path: Path) -> None:
    message = FILES[case][1]
    file = write(tmp_path, case)
    before = time.process_time()
    with pytest.raises(PipelineError) as caught:
        load(file)
    spent = time.process_time() - before
    assert any(message in fault.text for fault in caught.value.faults)
    # Reading ahead through brackets is quadratic: they must be refused before that.
    assert spent < (0.1 if case == "brackets" else 0.5), f"{spent:.2f} s of CPU"


@pytest.mark.parametrize("case", ["merge bomb", "brackets", "many items", "far too large"])
def test_hostile_file_costs_the_command_little_memory(case: str, tmp_path: Path) -> None:
    file = write(tmp_path, case)
    # Its own high-water mark: what wait4 tells includes the fork of this large process before exec.
    program = f"""
import re
from lodeline.cli import main
code = main(["check", {str(file)!r}])
print(code, re.search("VmHWM:\\\\s+(\\\\d+)", open("/proc/self/status").read())[1])
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert FILES[case][1] in done.stdout
    code, peak = done.stdout.split()[-2:]
    assert code == "3"
    assert int(peak) < 100_000  # kB


def test_depth_and_items_just_below_the_limits_are_read(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.yaml"
    depth = MAX_DEPTH - 1
    file.write_text(f"name: rig\nnodes: {'[' * depth}{']' * depth}\n")
    with pytest.raises(PipelineError, match="nodes must be a mapping"):
        load(file)
    file.write_text(f"name: rig\nnodes: [{'1,' * (MAX_ITEMS - 20)}1]\n")
    with pytest.raises(PipelineError, match="nodes must be a mapping"):
        load(file)
    file.write_text("name: rig\nnodes: {}\n#" + "x" * (MAX_BYTES - 24))
    assert file.stat().st_size > MAX_BYTES - 10
    with pytest.raises(PipelineError, match="the pipeline has no nodes"):
        load(file)
