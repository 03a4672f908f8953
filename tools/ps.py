"""Show the processes of running pipelines: state, restarts, cost; whether its files were edited.

With --check it also says what is not well: a process that does not run, a node that is degraded
or at fault, a rate that is off by more than a fifth, an output that is silent. Exit codes: 0 shown
(with --check: all is well), 1 a supervisor does not answer, or something is not well, 2 usage,
4 nothing runs, 5 a process has failed (with --check).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lodeline.pipeline.edited import edited, told

EXIT_FAILED, EXIT_NOTHING, EXIT_DIED = 1, 4, 5
TIMEOUT_S = 2.0
WELL = ("running", "done")
HEADINGS = ("PROCESS", "NODES", "STATE", "PID", "RESTARTS", "LAST EXIT", "UPTIME", "CPU", "RSS", "")
RIGHT = ("PID", "RESTARTS", "UPTIME", "CPU", "RSS")


def main(argv: list[str]) -> int:
    """Run `lodeline ps`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.run_folder import running
    from lodeline.watch import NothingThereError, choose

    here = running(arguments.name)
    if not here:
        try:
            choose(arguments.name)  # has the words for it
        except NothingThereError as error:
            print(error, file=sys.stderr)
        return EXIT_NOTHING
    reports: dict[str, dict[str, Any]] = {}
    silent = False
    for item in here:
        manifest = item.manifest
        answers = _ask(item.folder, f"{manifest.name}/@ps/*")
        for host, report in answers:
            changed = edited(manifest.sources) if host == manifest.host else []
            known = {"pipeline": manifest.name, "host": host, "edited": changed}
            # Two machines may claim one host: both are shown.
            reports[f"{manifest.name}@{host} {report['pid']}"] = known | report
        if manifest.host not in {host for host, _ in answers}:
            silent = True
            who = f"{manifest.name}@{manifest.host}"
            print(f"{who}: its supervisor, pid {manifest.pid}, is silent", file=sys.stderr)
    if arguments.json:
        print(json.dumps([reports[name] for name in sorted(reports)], indent=2))
    elif reports:
        print("\n\n".join(_shown(reports[name]) for name in sorted(reports)))
    worst = _check(reports.values()) if arguments.check else 0
    return worst or (EXIT_FAILED if silent else 0)


def _check(reports: Iterable[dict[str, Any]]) -> int:
    """Say on standard error what is not well; the exit code."""
    code = 0
    for report in reports:
        if text := told(report["edited"]):  # no fault of what runs
            print(f"{report['pipeline']}@{report['host']}: {text}", file=sys.stderr)
        for process in report["processes"]:
            name, state, status = process["process"], process["state"], process["status"]
            if state not in WELL:
                status = f"{state}, last exit {process['last_exit'] or 'none'}"
            if status:
                print(f"{report['pipeline']}@{report['host']} {name}: {status}", file=sys.stderr)
                code = EXIT_DIED if state == "failed" else code or EXIT_FAILED
    return code


def parser() -> argparse.ArgumentParser:
    """What `lodeline ps` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline ps",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--name", help="this pipeline only")
    parser.add_argument("--check", action="store_true", help="exit with 1 unless all is well")
    parser.add_argument("--json", action="store_true", help="one JSON list on standard output")
    return parser


def _ask(folder: Path, key: str) -> list[tuple[str, dict[str, Any]]]:
    """(host, report) of all supervisors that this hub can reach."""
    from lodeline.bus import BusError
    from lodeline.sessions import query

    try:
        answers = query(folder, key, TIMEOUT_S)
    except BusError:
        return []
    return [(key.rpartition("/")[2], json.loads(data)) for key, data in answers]


def _shown(report: dict[str, Any]) -> str:
    head = f"{report['pipeline']} on {report['host']}: supervisor {report['pid']}, "
    head += f"up {_duration(report['uptime'])}, pipeline {report['digest']}"
    head += "".join(f"\n  {_link(link)}" for link in report["links"])
    head += f"\n  {text}" if (text := told(report["edited"])) else ""
    if refused := report.get("refused"):
        head += f"\n  LINK_REFUSED {refused['who']}: {refused['why']}: {refused['remedy']}"
    if slow := report.get("slow"):
        head += f"\n  {slow}"
    rows = [HEADINGS, *(_row(process) for process in report["processes"])]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    lines = [
        "  ".join(
            word.rjust(width) if name in RIGHT else word.ljust(width)
            for name, word, width in zip(HEADINGS, row, widths, strict=True)
        ).rstrip()
        for row in rows
    ]
    return "\n".join((head, *lines))


def _link(link: dict[str, Any]) -> str:
    """One line on another host of the pipeline."""
    text = f"link to {link['host']}: {link['state']} {_duration(link['seconds'])}"
    if link["machine"]:
        text += f", machine {link['machine']}"
    if clock := link["clock"]:
        text += f", its clock {clock['offset']:+.4f} s +- {clock['error'] * 1e3:.1f} ms"
    return "".join((text, *(f"; MISMATCH {fault}" for fault in link["faults"])))


def _row(process: dict[str, Any]) -> tuple[str, ...]:
    notes = [process["scheduling"], process["status"]]
    if process["refused"]:
        notes.append(f"refused: {process['refused']}")
    return (
        process["process"],
        " ".join(process["nodes"]),
        process["state"],
        _or_dash(process["pid"]),
        str(process["restarts"]),
        process["last_exit"] or "-",
        "-" if process["uptime"] is None else _duration(process["uptime"]),
        "-" if process["cpu"] is None else f"{process['cpu']:.1%}",
        "-" if process["rss"] is None else f"{process['rss'] / 2**20:.0f} MB",
        ", ".join(note for note in notes if note),
    )


def _or_dash(value: Any) -> str:
    return "-" if value is None else str(value)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}h{minutes:02d}m" if hours else f"{minutes}m{rest:02d}s"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
