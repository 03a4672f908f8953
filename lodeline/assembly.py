"""A run of a pipeline on this machine, put together: folder, log, bus, other hosts, supervisor."""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from lodeline.clock import HostClock, StepWatch, epoch_offset
from lodeline.hosts.links import Link, LinkError, check_listen, keys_folder, link_of, shown, split
from lodeline.hosts.neighbours import Neighbours
from lodeline.hosts.offset import NodeTime, Offset
from lodeline.hosts.share import share_of
from lodeline.hosts.wires import Wires
from lodeline.memory import IdleCode, settle
from lodeline.notify import Notifier
from lodeline.pipeline.edited import fingerprints
from lodeline.pipeline.model import Pipeline
from lodeline.run_folder import Key, Manifest, Reader, RunFolder, log_folder, marker_of
from lodeline.supervisor.plan import Plan, plans_of
from lodeline.supervisor.run_log import RunLog
from lodeline.supervisor.supervisor import Supervisor

CLOSE_S = 1.0


def run(pipeline: Pipeline, host: str | None, seconds: float | None, began: float) -> int:
    """Run the share of a host, linked with the others, or all hosts by this machine alone.

    Ends `seconds` after the sources were let go, if not before: the exit code. `began` [s,
    monotonic] is when it was asked for. RunFolderError, BusError, LinkError or KeysError if it
    cannot start.
    """
    hosts = [host] if host else [each for each in pipeline.hosts if pipeline.processes(each)]
    link = link_of(pipeline, host) if host else Link()
    check_listen(link.listen)
    if host and "tls" in link.protocols:
        _check_keys(pipeline, host)
    own = epoch_offset()
    with RunFolder(pipeline.name, hosts, pipeline.digest, own) as folder, ExitStack() as closing:
        # Samples come from the host that listens, so its time is everybody's.
        reference = next((each.name for each in pipeline.hosts.values() if each.listen), None)
        node_time = NodeTime(own, reference if link.ends and reference != host else None)
        plans = plans_of(pipeline, hosts, folder.path, node_time.epoch, folder.resumes)
        log = RunLog([plan.name for plan in plans], log_folder() / pipeline.name / folder.path.name)
        closing.callback(log.close)
        size = _size(plans)
        log.event(f"{_shown(pipeline.file)}: {pipeline.name} on {folder.path.name}, {size}")
        _tell_what_was(folder, log.event)
        manifest = _manifest(pipeline, hosts, link.withheld, own)
        folder.publish(manifest)
        wires = Wires(folder.path, link, pipeline, manifest.host, log.event)
        closing.callback(wires.close, CLOSE_S)
        others = tuple(each for each in pipeline.hosts if link.ends and each != host)
        share = share_of(pipeline, hosts, manifest.host, shown(link.listen))
        neighbours = Neighbours(wires.hub, share, others, log.event, HostClock(own))
        closing.callback(neighbours.close)
        closing.callback(log.unpublish)
        if link.ends and (why := neighbours.rival()):
            raise LinkError(why)
        neighbours.claim()
        care = Care(log.event, own, size, began)
        supervisor = Supervisor(
            plans,
            folder.path,
            log.console,
            [marker_of(folder.path)],
            on_release=care.on_release,
            on_beat=care.on_beat,
        )
        neighbours.on_offset = partial(_follow, node_time, log.event, supervisor.tell_all)
        _answer(wires, pipeline, manifest.host, plans, supervisor, neighbours)
        log.publish(wires.hub, f"{pipeline.name}/@log/{manifest.host}")
        return asyncio.run(supervisor.run(seconds))


class Care:
    """What a supervisor sees to beside its nodes, and says to whoever started it (systemd)."""

    def __init__(self, event: Callable[[str], None], own: int, size: str, began: float) -> None:
        self._event, self._size, self._began = event, size, began
        self._service, self._wall = Notifier(), StepWatch(own)
        self._idle_code: IdleCode | None = None

    def on_release(self) -> None:
        """All nodes are up, and the sources were let go."""
        now = time.monotonic()
        self._event(f"up in {now - self._began:.1f} s: {self._size}")
        self._event("look: `lodeline topic hz`, `lodeline ps`; stop: Ctrl-C")
        self._service.send(f"READY=1\nSTATUS={self._size}")
        self._idle_code = IdleCode(now)
        settle()

    def on_beat(self) -> None:
        """Another second."""
        self._service.send("WATCHDOG=1")
        if self._idle_code is not None:
            self._idle_code.look(time.monotonic())
        if step := self._wall.look():
            self._event(f"CLOCK_STEP {step:+.0f} s: stamps keep to the time of the start")


def _check_keys(pipeline: Pipeline, host: str) -> None:
    # It takes the cryptography package, which only hosts with keys have.
    from lodeline.hosts.certificates import check

    listen = pipeline.hosts[host].listen
    address = None if listen is None else split(listen.removeprefix("tls/"))[0]
    for warning in check(keys_folder(pipeline), host, address):
        print(f"warning: {warning}", file=sys.stderr)


def _tell_what_was(folder: RunFolder, event: Callable[[str], None]) -> None:
    """Of a run before this one that did not end well."""
    if folder.unclean:
        killed = _count(len(folder.leftovers), "process", "es")
        event(f"LEFTOVER files of a run that died were removed, {killed} killed")
    if folder.resumes:
        event("RESUMED nodes go on from their states in that run")


def _follow(
    node_time: NodeTime,
    event: Callable[[str], None],
    tell_all: Callable[[str], None],
    other: str,
    offset: Offset,
) -> None:
    """Have the nodes go by another host's clock, if it is the one to go by."""
    if node_time.follow(other, offset):
        event(f"TIME of {other} from now on: {offset.seconds:+.6f} s")
        tell_all(f"epoch {node_time.epoch()}")


def _answer(
    wires: Wires,
    pipeline: Pipeline,
    host: str,
    plans: Sequence[Plan],
    supervisor: Supervisor,
    neighbours: Neighbours,
) -> None:
    """Serve what tools ask of a run: how its processes are, and to start a node again."""

    def report() -> bytes:
        about = {"digest": pipeline.digest, "links": neighbours.describe(), **wires.ails()}
        return json.dumps(about | supervisor.report()).encode()

    def restart(node: str) -> bytes:
        return supervisor.restart(node).encode()

    wires.hub.serve(f"{pipeline.name}/@ps/{host}", report)
    for plan in plans:
        for node in plan.nodes:
            wires.hub.serve(f"{pipeline.name}/@restart/{plan.host}/{node}", partial(restart, node))


def _manifest(
    pipeline: Pipeline, hosts: Sequence[str], withheld: Sequence[str], epoch: int
) -> Manifest:
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


def _shown(file: Path) -> str:
    """The file as one would type it here."""
    file, here = file.resolve(), Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)


def _size(plans: Sequence[Plan]) -> str:
    nodes = sum(len(plan.nodes) for plan in plans)
    return f"{_count(nodes, 'node')} in {_count(len(plans), 'process', 'es')}"


def _count(number: int, noun: str, plural: str = "s") -> str:
    return f"{number} {noun}{'' if number == 1 else plural}"
