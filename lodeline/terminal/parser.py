"""The parser of a verb that has verbs below it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from lodeline.params import closest


class VerbParser(argparse.ArgumentParser):
    """What a verb below does not take is told with that verb's usage, not with the one above."""

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """As its parent's, but what is not known is an error at once: exit 2."""
        found, left = super().parse_known_args(args, namespace)
        if left:
            options = [name[2:] for name in self._option_string_actions if name.startswith("--")]
            word = left[0].partition("=")[0]
            like = closest(word[2:], options) if word.startswith("--") else None
            near = f", did you mean --{like}?" if like else ""
            self.error(f"unrecognized arguments: {' '.join(left)}{near}")
        return found, left
