"""Print a systemd unit that starts a pipeline with the machine.

    lodeline service robot.yaml --host robot | sudo tee /etc/systemd/system/lodeline.service

The unit is of type notify: systemd hears when the sources have been let go, and starts the
supervisor again when its loop stands still. Its run folder is /run/lodeline: tools find it with
LODELINE_RUN=/run/lodeline. Exit codes: 0 printed, 2 usage, 3 invalid pipeline.
"""

from __future__ import annotations

import argparse
import getpass
import sys

EXIT_USAGE, EXIT_INVALID = 2, 3
WATCHDOG_S = 10

UNIT = """\
[Unit]
Description=Lodeline pipeline {name} ({file})
After=network.target
StartLimitIntervalSec=60
StartLimitBurst=5

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
WorkingDirectory={folder}
User={user}
RuntimeDirectory=lodeline
RuntimeDirectoryMode=0700
RuntimeDirectoryPreserve=restart
Environment=LODELINE_RUN=/run/lodeline
WatchdogSec={watchdog}
TimeoutStartSec=60
TimeoutStopSec=20
KillMode=mixed
Restart=on-failure
RestartSec=1
RestartPreventExitStatus=2 3
SuccessExitStatus=130
LimitRTPRIO=90
LimitMEMLOCK=infinity

[Install]
WantedBy=multi-user.target
"""


def main(argv: list[str]) -> int:
    """Run `lodeline service`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.pipeline.load import PipelineError, find, load

    try:
        pipeline = load(find(arguments.file))
    except PipelineError as error:
        print(error, file=sys.stderr)
        return EXIT_INVALID
    if arguments.host not in (None, *pipeline.hosts):
        known = ", ".join(pipeline.hosts)
        print(f"{pipeline.name} has no host {arguments.host!r} (hosts: {known})", file=sys.stderr)
        return EXIT_USAGE
    file = pipeline.file.resolve()
    words = [sys.executable, "-P", "-m", "lodeline", "up", str(file)]
    if arguments.host:
        words += ["--host", arguments.host]
    unit = UNIT.format(
        name=pipeline.name,
        file=_literal(file.name),
        command=" ".join(_quoted(word) for word in words),
        folder=_literal(str(file.parent)),
        user=arguments.user,
        watchdog=WATCHDOG_S,
    )
    print(unit, end="")
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline service` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline service",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "file",
        nargs="?",
        help="pipeline file or profile (default: ./pipeline.yaml, else the one that comes along)",
    )
    parser.add_argument("--host", help="start this host's share only")
    parser.add_argument("--user", default=getpass.getuser(), help="who runs it (default: you)")
    return parser


def _literal(text: str) -> str:
    """Text in which systemd finds nothing to replace."""
    return text.replace("%", "%%")


def _quoted(word: str) -> str:
    """A word of a command line, as systemd reads it."""
    safe = _literal(word).replace("\\", "\\\\").replace('"', '\\"').replace("$", "$$")
    return f'"{safe}"' if any(mark in safe for mark in " \\\"'$") else safe


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
