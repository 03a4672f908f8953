"""How far the clocks of the hosts of a running pipeline are apart, with an error bar."""

from __future__ import annotations

import time

from lodeline.doctor.report import Report
from lodeline.hosts.offset import Offset, better, measured
from lodeline.watch import Watch

QUESTIONS = 20
LARGE_S = 0.1
VAGUE_S = 0.05


def check_clocks(report: Report, watch: Watch) -> dict[str, dict[str, float]]:
    """Check each host's clock against this machine's; `offset` and bar `error` [s] by host."""
    found = _measure(watch)
    for host, known in found.items():
        _check_offset(report, f"clock of {host}", known["offset"], known["error"])
    wanted = set(watch.manifest.places.values()) | set(watch.manifest.hosts)
    for host in sorted(wanted - {part for word in found for part in word.split("+")}):
        fix = "`lodeline doctor net` says whether it is up and linked"
        report.add(f"clock of {host}", "FAIL", "no answer", fix)
    return found


def _measure(watch: Watch) -> dict[str, dict[str, float]]:
    offsets: dict[str, Offset] = {}
    for _ in range(QUESTIONS):
        sent = time.time_ns()
        for host, answer in watch.ask("@clock", "/*").items():
            now = time.monotonic_ns()
            found = measured(sent, int(answer), time.time_ns(), now)
            offsets[host] = better(offsets.get(host), found, now)
    now = time.monotonic_ns()
    return {
        host: {"offset": round(offset.seconds, 6), "error": round(offset.aged(now), 6)}
        for host, offset in sorted(offsets.items())
    }


def _check_offset(report: Report, name: str, offset: float, error: float) -> None:
    text = f"{offset * 1e3:+.2f} +- {error * 1e3:.2f} ms ahead of this machine's"
    if abs(offset) > max(LARGE_S, error):
        text += "; nodes go by the listening host's time meanwhile"
        report.add(name, "warn", text, "set one of them: timedatectl set-ntp true")
    elif error > VAGUE_S:
        text += "; ages across hosts are no better known than that"
        report.add(name, "warn", text, "a slow way there and back: come nearer, or use a cable")
    else:
        report.add(name, "ok", text)
