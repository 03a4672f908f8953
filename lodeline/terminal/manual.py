"""The manual of the command line, docs/cli.md: `python -m lodeline.terminal.manual > docs/cli.md`.

Written from the parsers' contents, not from argparse's help, which differs between Pythons.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from lodeline.terminal.verbs import parsers

HEAD = """\
# The command line

Generated from the tools' own parsers by `python -m lodeline.terminal.manual`; do not edit.

Data go to standard output, all else to standard error. Every verb that reads has `--json`. Keys
may be given without the pipeline's name, or by their end if it is unique. Colours stay away where
`NO_COLOR` is set.

Exit codes: 0 fine, 1 failed, 2 usage, 3 invalid pipeline, 4 nothing there, 5 a node died,
130 interrupted."""


BAR = "\\|"


def manual() -> str:
    """The whole text."""
    sections = [HEAD]
    for verb, parser in parsers().items():
        sections.append("\n\n".join(_section(f"lodeline {verb}", parser, 2)))
    return "\n\n".join(sections) + "\n"


def _section(
    name: str, parser: argparse.ArgumentParser, level: int, text: str = ""
) -> Iterator[str]:
    yield f"{'#' * level} {name}"
    yield (parser.description or f"{_sentence(text)}.").strip()
    actions = [action for action in parser._actions if action.dest != "help"]
    below = [action for action in actions if isinstance(action, argparse._SubParsersAction)]
    own = [action for action in actions if action not in below]
    words = " ".join([name, *map(_in_usage, own), *(["VERB ..."] if below else [])])
    yield f"```\n{words}\n```"
    if rows := [_row(action) for action in own]:
        yield "\n".join(["| argument | meaning |", "|---|---|", *rows])
    for action in below:
        captions = {choice.dest: choice.help or "" for choice in action._choices_actions}
        for verb, parser_below in action.choices.items():
            yield from _section(f"{name} {verb}", parser_below, level + 1, captions[verb])


def _value(action: argparse.Action) -> str:
    """The value of an argument as it is shown: `FILE`, `bash|zsh`."""
    if action.choices:
        return "|".join(str(choice) for choice in action.choices)
    metavar = action.metavar if isinstance(action.metavar, str) else None
    return metavar or (action.dest.upper() if action.option_strings else action.dest)


def _in_usage(action: argparse.Action) -> str:
    value = _value(action)
    if action.nargs in ("*", "+"):
        value = f"{value} [{value} ...]"
    if not action.option_strings:
        return f"[{value}]" if action.nargs in ("?", "*") else value
    shown = action.option_strings[0] + ("" if action.nargs == 0 else f" {value}")
    return shown if action.required else f"[{shown}]"


def _row(action: argparse.Action) -> str:
    names = ", ".join(f"`{name}`" for name in action.option_strings) or f"`{_value(action)}`"
    if action.option_strings and action.nargs != 0:
        names += f" `{_value(action)}`"
    # A bar divides cells even inside of a code span.
    cells = (names, _sentence((action.help or "").replace("%%", "%")))
    return f"| {' | '.join(cell.replace('|', BAR) for cell in cells)} |".replace("|  |", "| |")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


if __name__ == "__main__":
    print(manual(), end="")
