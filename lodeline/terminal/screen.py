"""A text that is shown again and again: in place on a terminal, one after the other elsewhere."""

from __future__ import annotations

import os
import shutil
import sys
from typing import Self

ENTER, LEAVE = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
HOME, END_OF_LINE, REST = "\x1b[H", "\x1b[K", "\x1b[J"


def colours() -> bool:
    """Whether standard output is a terminal whose user did not ask for NO_COLOR."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


class Block:
    """A few lines on standard error, shown in place; none where that is no terminal."""

    def __init__(self) -> None:
        self.seen = sys.stderr.isatty()
        self._lines = 0

    def show(self, text: str) -> None:
        """Show a text instead of the one before, below whatever else was printed."""
        if not self.seen:
            return
        wide = shutil.get_terminal_size().columns
        lines = [line[:wide] + END_OF_LINE for line in text.splitlines()]
        back = f"\x1b[{self._lines}A" if self._lines else ""
        sys.stderr.write(f"\r{back}{REST}" + "".join(f"{line}\n" for line in lines))
        sys.stderr.flush()
        self._lines = len(lines)


class Screen:
    """`with Screen() as screen: screen.show(text)`; on a terminal long lines are cut."""

    def __init__(self) -> None:
        self._terminal = sys.stdout.isatty()

    def show(self, text: str) -> None:
        """Show a text instead of the one before."""
        if not self._terminal:
            print(f"{text}\n", flush=True)
            return
        wide, high = shutil.get_terminal_size()
        lines = [line[:wide] + END_OF_LINE for line in text.splitlines()[:high]]
        sys.stdout.write(HOME + "\n".join(lines) + REST)
        sys.stdout.flush()

    def _write(self, code: str) -> None:
        if self._terminal:
            sys.stdout.write(code)
            sys.stdout.flush()

    def __enter__(self) -> Self:
        self._write(ENTER)
        return self

    def __exit__(self, *_: object) -> None:
        self._write(LEAVE)
