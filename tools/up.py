"""Start a pipeline, keep it alive, and stop it in order.

Log lines of all nodes come on standard error. Ctrl-C stops in order, a second one kills. Without
--host this machine plays all hosts of the pipeline and opens no port; with it, the link that the
file gives that host is opened, and the other hosts may come and go.

Exit codes: 0 stopped, 1 failed to start, 2 usage, 3 invalid pipeline, 5 a required node failed
or none is left, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
import time

from lodeline.terminal.numbers import seconds

EXIT_FAILED, EXIT_USAGE, EXIT_INVALID = 1, 2, 3


def main(argv: list[str]) -> int:
    """Run `lodeline up`; the exit code."""
    began = time.monotonic()
    arguments = parser().parse_args(argv)
    from lodeline.pipeline.elsewhere import Reading
    from lodeline.pipeline.faults import PipelineError

    reading = Reading(arguments.file, arguments.set)
    _get_ready()
    try:
        pipeline = reading.pipeline()
    except PipelineError as error:
        print(error, file=sys.stderr)
        return EXIT_INVALID
    for warning in pipeline.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if arguments.host not in (None, *pipeline.hosts):
        known = ", ".join(pipeline.hosts)
        print(f"{pipeline.name} has no host {arguments.host!r} (hosts: {known})", file=sys.stderr)
        return EXIT_USAGE

    from lodeline.assembly import run
    from lodeline.bus import BusError
    from lodeline.hosts.certificates import KeysError
    from lodeline.hosts.links import LinkError
    from lodeline.run_folder import RunFolderError

    try:
        return run(pipeline, arguments.host, arguments.seconds, began)
    except (RunFolderError, BusError, LinkError, KeysError) as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED


def _get_ready() -> None:
    """Import what a supervisor needs, while its pipeline is being read."""
    from lodeline.memory import be_sparing

    be_sparing()
    # asyncio goes without ssl where it finds none, and hashlib has hashes of its own: 3 MB and more
    # of OpenSSL that nothing here has any use for.
    unwanted = {name: None for name in ("ssl", "_hashlib") if name not in sys.modules}
    sys.modules.update(unwanted)  # type: ignore[arg-type]
    import lodeline.assembly  # noqa: F401

    for name in unwanted:
        del sys.modules[name]


def parser() -> argparse.ArgumentParser:
    """What `lodeline up` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline up",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "file",
        nargs="?",
        help="pipeline file or profile (default: ./pipeline.yaml, else the one that comes along)",
    )
    parser.add_argument("--host", help="start this host's share only")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAM=VALUE",
        help="override a parameter; may be given several times",
    )
    parser.add_argument(
        "--seconds", type=seconds, metavar="N", help="stop N seconds after the sources started"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
