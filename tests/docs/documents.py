"""The documents as a test reads them: blocks in order, and what is to be done with each.

A comment before a block says what a reader sees without it, `<!-- test: WORDS -->`:

    exits 3                  that is how its commands end
    file map.yaml            it is a file of that name; `append map.yaml`: the end of one
    on the robot             that is another folder and another run folder
    stays up                 its command goes on while blocks that follow say `while it runs`
    while make demo runs     as `while it runs`, of a command that stands in no block before

Several of them stand apart by commas.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.support.live import ROOT

ELSEWHERE = ("docs/cli.md", "docs/nodes.md", "docs/plots.md")
"""Generated, or done by test_plots_page."""
DOCUMENTS = tuple(
    file.relative_to(ROOT).as_posix()
    for file in (
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").glob("*.md")),
    )
    if file.relative_to(ROOT).as_posix() not in ELSEWHERE
)
_BLOCK = re.compile(
    r"(?:^<!-- test: (?P<order>[^\n]*?) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
LANGUAGES = ("", "text", "sh", "console", "python", "yaml", "mermaid")
PRINTED = ("", "text")
SHORTER = (
    ("make demo", "SECONDS=2"),
    ("lodeline demo", "--seconds 2"),
    ("lodeline up", "--seconds 1"),
    ("lodeline dash", "--seconds 1"),
    ("lodeline topic echo", "-n 1"),
    ("lodeline top", "--once"),
    ("lodeline bag play", "--rate 40"),
    ("lodeline bag record", "--seconds 2"),
    ("lodeline calibrate gyro", "--seconds 2.5"),
    ("lodeline calibrate wheels --distance", "--distance 1"),
    ("lodeline calibrate wheels --turns", "--turns 2"),
)
"""What takes long or would never end, and the words that end it soon; the last of a kind holds."""


@dataclass(frozen=True, slots=True)
class Block:
    """A block of code; `order` is what the comment before it says, "" without one."""

    language: str
    order: str
    text: str
    line: int

    def says(self, word: str) -> str | None:
        """What follows a word of the order; None if it is not there."""
        for each in self.order.split(", "):
            if each.startswith(word):
                return each.removeprefix(word).strip()
        return None

    @property
    def commands(self) -> list[str]:
        """The commands of a shell block, without comments."""
        if self.language == "console":
            lines = [line[2:] for line in self.text.splitlines() if line.startswith("$ ")]
        else:
            lines = self.text.replace("\\\n", " ").splitlines()
        bare = [re.split(r"(?:^|\s)#\s", line)[0].strip() for line in lines]
        return [line for line in bare if line]


def shorter(line: str) -> str:
    """A command that ends soon."""
    for start, more in SHORTER:
        if f"{line} ".startswith(f"{start} "):
            return line if "=" in more and more.split("=")[0] in line else f"{line} {more}"
    return line


def text_of(document: str) -> str:
    return (ROOT / document).read_text()


def blocks(document: str) -> list[Block]:
    """All blocks of a document, in order."""
    text = text_of(document)
    return [
        Block(
            found["language"],
            found["order"] or "",
            found["text"],
            text.count("\n", 0, found.start()) + 1,
        )
        for found in _BLOCK.finditer(text)
    ]


def links(document: str) -> Iterator[tuple[Path, str]]:
    """(file, anchor) of each link that leads to a place of the project."""
    for target in _LINK.findall(text_of(document)):
        if not target.startswith("https://"):
            path, _, anchor = target.partition("#")
            here = ROOT / document
            yield (here.parent / path if path else here), anchor


def anchors(file: Path) -> set[str]:
    """Where a link into a document may lead."""
    titles = re.findall(r"^#+ (.*)$", file.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
