"""A row of numbered checks: each with a verdict, what was seen and, if it is not fine, one fix."""

from __future__ import annotations

import errno
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

Verdict = Literal["ok", "warn", "FAIL", "skip"]

MEANINGS = {
    errno.EREMOTEIO: "nobody acknowledged that address",
    errno.ENXIO: "nobody acknowledged that address",
    errno.EIO: "the transaction broke off: a bad contact, or two masters",
    errno.ETIMEDOUT: "the bus does not come free: SDA or SCL is held low",
    errno.EACCES: "no rights on the device file",
    errno.EBUSY: "a driver of the kernel holds that address",
}


@dataclass(frozen=True, slots=True)
class Check:
    """One check. `fix` is a line for who wants to put it right, empty where nothing is wrong."""

    number: int
    name: str
    verdict: Verdict
    text: str
    fix: str = ""

    def __str__(self) -> str:
        line = f"{self.number:2}  {self.verdict:4}  {self.name}: {self.text}"
        return f"{line}\n          fix: {self.fix}" if self.fix else line


class Report:
    """Collects checks, and shows each as soon as it is done."""

    def __init__(self, show: Callable[[Check], None] | None = None) -> None:
        self.checks: list[Check] = []
        self._show = show

    def add(self, name: str, verdict: Verdict, text: str, fix: str = "") -> Verdict:
        """Add a check under the next number; its verdict."""
        check = Check(len(self.checks) + 1, name, verdict, text, fix)
        self.checks.append(check)
        if self._show is not None:
            self._show(check)
        return verdict

    @property
    def failed(self) -> bool:
        """Whether any check failed."""
        return any(check.verdict == "FAIL" for check in self.checks)

    def plain(self) -> dict[str, Any]:
        """All of it as JSON has it."""
        return {"fine": not self.failed, "checks": [asdict(check) for check in self.checks]}


def meaning(error: OSError) -> str:
    """What an errno says about an I2C bus."""
    text = MEANINGS.get(error.errno or 0, error.strerror or str(error))
    return f"errno {error.errno}: {text}"
