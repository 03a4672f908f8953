"""Start a pipeline, keep it alive, and stop it in order.

Log lines of all nodes come on standard error. Ctrl-C stops in order, a second one kills. Without
--host this machine plays all hosts of the pipeline and opens no port; with it, the link that the
file gives that host is opened, and the other hosts may come and go.

Exit codes: 0 stopped, 1 failed to start, 2 usage, 3 invalid pipeline, 5 a required node failed
or none is left, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.terminal.numbers import seconds

if TYPE_CHECKING:
    from lodeline.hosts.offset import Offset
    from lodeline.pipeline.model import Pipeline
    from lodeline.run_folder import Manifest
    from lodeline.supervisor.supervisor import Supervisor

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

    from lodeline.bus import BusError
    from lodeline.hosts.certificates import KeysError
    from lodeline.hosts.links import LinkError
    from lodeline.run_folder import RunFolderError

    try:
        return _up(pipeline, arguments.host, arguments.seconds, began)
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
    import lodeline.bus
    import lodeline.hosts.neighbours
    import lodeline.supervisor.log_files
    import lodeline.supervisor.supervisor  # noqa: F401

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


def _up(pipeline: Pipeline, host: str | None, seconds: float | None, began: float) -> int:
    """Run the share of a host, linked with the others, or all hosts by this machine alone."""
    import asyncio
    from contextlib import nullcontext

    from lodeline.bus import Gateway, Hub, overhear_links, several_threads
    from lodeline.clock import HostClock, StepWatch, epoch_offset
    from lodeline.hosts.links import Link, LinkError, check_listen, link_of, shown
    from lodeline.hosts.neighbours import Neighbours
    from lodeline.hosts.offset import NodeTime
    from lodeline.hosts.refusals import Refusals
    from lodeline.hosts.share import share_of
    from lodeline.hosts.slowness import Advice, Slowness
    from lodeline.memory import IdleCode, settle
    from lodeline.notify import Notifier
    from lodeline.run_folder import RunFolder, log_folder, marker_of
    from lodeline.supervisor.log_files import LogFiles
    from lodeline.supervisor.logbook import LogBook
    from lodeline.supervisor.logs import Console
    from lodeline.supervisor.plan import plans_of
    from lodeline.supervisor.supervisor import Supervisor

    hosts = [host] if host else [each for each in pipeline.hosts if pipeline.processes(each)]
    link = link_of(pipeline, host) if host else Link()
    check_listen(link.listen)
    if "tls" in link.protocols and host:
        from lodeline.hosts.certificates import check
        from lodeline.hosts.links import keys_folder, split

        listen = pipeline.hosts[host].listen
        address = None if listen is None else split(listen.removeprefix("tls/"))[0]
        for warning in check(keys_folder(pipeline), host, address):
            print(f"warning: {warning}", file=sys.stderr)
    own = epoch_offset()
    with RunFolder(pipeline.name, hosts, pipeline.digest, own) as run:
        # Samples come from the host that listens, so its time is everybody's.
        reference = next((each.name for each in pipeline.hosts.values() if each.listen), None)
        node_time = NodeTime(own, reference if link.ends and reference != host else None)
        plans = plans_of(pipeline, hosts, run.path, node_time.epoch, run.resumes)
        book = LogBook()
        files = LogFiles(
            log_folder() / pipeline.name / run.path.name, lambda text: console.event(text)
        )

        def keep(name: str, text: str) -> None:
            book.add(name, text)
            files.add(name, text)

        names = [plan.name for plan in plans]
        console = Console(sys.stderr.fileno(), names, _coloured(), keep)
        try:
            nodes = sum(len(plan.nodes) for plan in plans)
            size = f"{_count(nodes, 'node')} in {_count(len(plans), 'process', 'es')}"
            console.event(f"{_shown(pipeline.file)}: {pipeline.name} on {run.path.name}, {size}")
            if run.unclean:
                killed = _count(len(run.leftovers), "process", "es")
                console.event(f"LEFTOVER files of a run that died were removed, {killed} killed")
            if run.resumes:
                console.event("RESUMED nodes go on from their states in that run")
            manifest = _manifest(pipeline, hosts, link.withheld, own)
            run.publish(manifest)

            def on_release() -> None:
                elapsed = time.monotonic() - began
                console.event(f"up in {elapsed:.1f} s: {size}")
                console.event("look: `lodeline topic hz`, `lodeline ps`; stop: Ctrl-C")
                service.send(f"READY=1\nSTATUS={size}")
                settle()

            service = Notifier()  # whoever started us, if it is systemd

            wall = StepWatch(own)
            idle_code = IdleCode(time.monotonic())  # the pipeline is up before that time is over

            def on_beat() -> None:
                service.send("WATCHDOG=1")
                idle_code.look(time.monotonic())
                if step := wall.look():
                    console.event(f"CLOCK_STEP {step:+.0f} s: stamps keep to the time of the start")

            refusals = Refusals(console.event)
            if link.ends:
                overhear_links(refusals.take)
            with several_threads() if link.ends else nullcontext():
                hub = Hub(run.path)
            advice = Advice(
                hub.collect_kept,
                pipeline.name,
                manifest.host,
                pipeline.link_rate,
                pipeline.read_elsewhere(manifest.host),
            )
            slowness = Slowness(console.event, advice)
            gateway = Gateway(run.path, link, slowness.look) if link.ends else None
            others = tuple(each for each in pipeline.hosts if link.ends and each != host)
            share = share_of(pipeline, hosts, manifest.host, shown(link.listen))
            neighbours = Neighbours(hub, share, others, console.event, HostClock(own))
            try:
                if link.ends and (why := neighbours.rival()):
                    raise LinkError(why)
                neighbours.claim()
                supervisor = Supervisor(
                    plans,
                    run.path,
                    console,
                    [marker_of(run.path)],
                    on_release=on_release,
                    on_beat=on_beat,
                )

                def on_offset(other: str, offset: Offset) -> None:
                    if node_time.follow(other, offset):
                        console.event(f"TIME of {other} from now on: {offset.seconds:+.6f} s")
                        supervisor.tell_all(f"epoch {node_time.epoch()}")

                neighbours.on_offset = on_offset

                def report() -> bytes:
                    refused = refusals.current()
                    slow = slowness.current(time.monotonic())
                    about = {
                        "digest": pipeline.digest,
                        "links": neighbours.describe(),
                        "refused": refused and refused._asdict(),
                        "slow": slow and str(slow),
                    }
                    return json.dumps(about | supervisor.report()).encode()

                hub.serve(f"{pipeline.name}/@ps/{manifest.host}", report)
                for plan in plans:
                    for node in plan.nodes:
                        key = f"{pipeline.name}/@restart/{plan.host}/{node}"
                        hub.serve(key, partial(_restart, supervisor, node))
                log_key = f"{pipeline.name}/@log/{manifest.host}"
                hub.serve(log_key, book.kept)
                book.publish(hub.publisher(log_key, "application/json"))
                return asyncio.run(supervisor.run(seconds))
            finally:
                book.close()
                neighbours.close()
                if gateway is not None:
                    gateway.close(timeout=1.0)
                hub.close(timeout=1.0)
        finally:
            files.close()
            console.close()


def _manifest(
    pipeline: Pipeline, hosts: Sequence[str], withheld: Sequence[str], epoch: int
) -> Manifest:
    from lodeline.pipeline.edited import fingerprints
    from lodeline.run_folder import Key, Manifest, Reader

    senders = {key: spec for spec in pipeline.nodes for key in spec.outputs.values()}
    readers: dict[str, tuple[Reader, ...]] = {}
    for spec in pipeline.nodes:
        for edge in spec.inputs.values():
            reader = Reader(spec.name, edge.queue, edge.max_age)
            readers[edge.key] = (*readers.get(edge.key, ()), reader)
    return Manifest(
        name=pipeline.name,
        hosts=tuple(hosts),
        pid=os.getpid(),
        started=time.time(),
        file=str(pipeline.file.resolve()),
        digest=pipeline.digest,
        clock=pipeline.clock,
        keys={
            key: Key(kind.__name__, senders[key].name if key in senders else None)
            for key, kind in pipeline.key_types().items()
        },
        nodes={spec.name: spec.process for spec in pipeline.nodes},
        places={spec.name: spec.host for spec in pipeline.nodes},
        readers=readers,
        withheld=tuple(withheld),
        overrides=pipeline.overrides,
        sources=fingerprints(pipeline),
        epoch=epoch,
    )


def _restart(supervisor: Supervisor, node: str) -> bytes:
    return supervisor.restart(node).encode()


def _coloured() -> bool:
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR")


def _shown(file: Path) -> str:
    """The file as one would type it here."""
    file, here = file.resolve(), Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)


def _count(number: int, noun: str, plural: str = "s") -> str:
    return f"{number} {noun}{'' if number == 1 else plural}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
