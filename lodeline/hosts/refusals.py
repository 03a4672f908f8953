"""Why a link between two hosts is refused: what zenoh writes of it, in words and with a remedy.

zenoh tries again twice a second, and writes a line each time; one line alone, as a port scanner
causes it, is not worth a word.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import NamedTuple

FRESH_S = 5.0
"""A reason counts as long as it is heard again within this time."""
AGAIN_S = 60.0
"""It is told again after this time."""

_DIALLED = re.compile(r"configured peer \w+/([^!#\s]+)")
_SCOUTED = re.compile(r"any locator of scouted peer \w+: \[\w+/([^\]#,]+)")
_IF_OURS = "if it is a host of this file, "
_ONE_AUTHORITY = "give both hosts ca.pem and keys of one authority"
_REASONS = {
    "invalid peer certificate: certificate expired": (
        "its certificate has expired",
        "`lodeline keys add` for that host, and start it again with the new files",
    ),
    "invalid peer certificate: certificate not valid yet": (
        "its certificate is not valid yet",
        "set the clock of this host",
    ),
    "invalid peer certificate: BadSignature": (
        "its certificate is of another authority than ca.pem here",
        _ONE_AUTHORITY,
    ),
    "invalid peer certificate: UnknownIssuer": (
        "its certificate is of another authority than ca.pem here",
        _ONE_AUTHORITY,
    ),
    "invalid peer certificate: certificate not valid for name": (
        "its certificate is not for this address",
        "`lodeline keys add` for that host with the address",
    ),
    "peer sent no certificates": ("it shows no certificate", _ONE_AUTHORITY),
    "InvalidContentType": (
        "it speaks without tls",
        "write `tls:` in its pipeline file as in this one",
    ),
    "Read error on TCP link": (
        "it hangs up on who speaks without tls",
        "write `tls:` in this pipeline file as in its",
    ),
    "fatal alert: CertificateExpired": (
        "it says that our certificate is not valid today",
        "`lodeline keys add` for this host, and look at the clock there",
    ),
    "fatal alert: DecryptError": (
        "it knows another authority than the one of our certificate",
        _ONE_AUTHORITY,
    ),
    "fatal alert: UnknownCA": (
        "it knows another authority than the one of our certificate",
        _ONE_AUTHORITY,
    ),
    "fatal alert: BadCertificate": (
        "it says that our certificate is not for the address it dialled",
        "`lodeline keys add` for this host with that address",
    ),
}


_OF_OURS = "`lodeline keys add`", "set the clock"
"""What these mend is of our own authority; anybody may come without tls or with another."""


class Refusal(NamedTuple):
    """Who is refused or refuses, why, and what mends it."""

    who: str
    why: str
    remedy: str


def refusal(line: str) -> Refusal | None:
    """What a line of zenoh's own log says of a refused link; None if it is of other things."""
    if scouted := _SCOUTED.search(line):  # zenoh does not say why
        remedy = f"{_IF_OURS}compare `tls:` and the keys of both"
        return Refusal(scouted[1], "it answers multicast, but there is no link with it", remedy)
    dialled = _DIALLED.search(line)
    for phrase, (why, remedy) in _REASONS.items():
        if phrase in line:
            if dialled:
                return Refusal(dialled[1], why, remedy)
            ours = "" if remedy.startswith(_OF_OURS) else _IF_OURS
            return Refusal("who connects here", why, ours + remedy)
    return None


class Refusals:
    """Collects such lines by `take`, in one thread; `event(text)` tells each reason each minute."""

    def __init__(
        self, event: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._event = event
        self._clock = clock
        self._last: tuple[Refusal, float] | None = None
        self._heard: dict[Refusal, float] = {}
        self._told: dict[Refusal, float] = {}

    def take(self, line: str) -> None:
        """A line that zenoh wrote."""
        found = refusal(line)
        if found is None:
            return
        now = self._clock()
        repeated = now - self._heard.get(found, -FRESH_S) < FRESH_S
        self._heard[found] = now
        self._last = found, now
        if repeated and now - self._told.get(found, -AGAIN_S) >= AGAIN_S:
            self._told[found] = now
            self._event(f"LINK_REFUSED {found.who}: {found.why}: {found.remedy}")

    def current(self) -> Refusal | None:
        """Why the link is refused now."""
        last = self._last  # another thread may replace it meanwhile
        return last[0] if last and self._clock() - last[1] < FRESH_S else None
