"""A node process: one node, or several wired by direct calls, on the bus and under supervision.

`nodes/attitude.py` runs itself with `run(Attitude)`; a process that nodes share is
`python -m lodeline.process`. Either way the supervisor says in LODELINE_LAUNCH what to be.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from lodeline.bus import Publisher
from lodeline.clock import Clock, HostClock, RecordingClock
from lodeline.graph import Graph
from lodeline.health import Gossip
from lodeline.inlet import Inlet, anybody
from lodeline.intake import Edge, Intake
from lodeline.keepsake import Keepsake
from lodeline.launch import VARIABLE, Launch, NodeLaunch
from lodeline.loading import load_node
from lodeline.memory import IdleCode, settle
from lodeline.missed import Missed
from lodeline.node import Context, Driver, Node
from lodeline.notify import Notifier
from lodeline.orders import Orders
from lodeline.params import build
from lodeline.sessions import Peer
from lodeline.status import StatusReporter
from lodeline.ticker import Ticker
from lodeline_msgs import Message, encoding_of

EX_USAGE, EX_DEVICE, EX_SOFTWARE, EX_CONFIG = 64, 69, 70, 78
BEAT_S = 0.2
STATUS_S = 1.0
"""A whole number of beats."""
GOLDEN = 0.618034
LAYING_S = 5.0
SILENCE_S = 5.0
MAX_FAILURES = 20
"""A node whose handler raised this often in a row is beyond help: its process ends."""


class NodeProcess:
    """The nodes of one launch, their wires and their threads.

    One lock serves the whole process: no two handlers ever run at once in it.
    """

    def __init__(self, launch: Launch, types: Mapping[str, type[Node[Any]]]) -> None:
        self.launch = launch
        self.lock = threading.RLock()
        self.host_clock = HostClock(launch.epoch_offset)
        self.clock: Clock = RecordingClock() if launch.clock == "recording" else self.host_clock
        self.failed = threading.Event()
        self._raised: set[tuple[str, str, int, str]] = set()
        folder = Path(launch.run_folder)
        self.nodes = {
            item.name: _make_node(item, types[item.name], folder) for item in launch.nodes
        }
        self.graph = Graph(
            self.nodes,
            {item.name: {port: e.key for port, e in item.inputs.items()} for item in launch.nodes},
            {item.name: item.outputs for item in launch.nodes},
            self._handler_failed,
        )
        self.keepsakes = {
            name: Keepsake(node, folder / "state") for name, node in self.nodes.items()
        }
        kept = self.keepsakes if launch.restarts or launch.resumes else {}
        marks = {name: item.restore() for name, item in kept.items()}
        self.missed = Missed()
        self.intake = Intake(self.lock)
        self.bus = Peer(folder, launch.process)
        self.publishers: dict[str, Publisher] = {}
        self.status = StatusReporter(self.launch, self.nodes, self.bus)
        self.gossip = Gossip()
        for item in launch.nodes:
            # Where all were down, nobody has sent what could be missed.
            self._connect(item, marks.get(item.name) if launch.restarts else None)
        self.tickers = [
            Ticker(node, self.host_clock, self.lock, self._ticking_failed)
            for node in self.nodes.values()
            if isinstance(node, Driver)
        ]

    def _connect(self, item: NodeLaunch, marks: Mapping[str, int] | None) -> None:
        """Lay the wires of a node; `marks` if it was restored, see `Keepsake`."""
        node = self.nodes[item.name]
        for port, key in item.outputs.items():
            message = type(node).outputs()[port].message
            publisher = self.bus.publisher(key, encoding_of(message))
            self.publishers[key] = publisher
            self.graph.tap(key, self.status.outlet(item.name, publisher, item.rates.get(port)))
        if type(node).calibrate is not Node.calibrate:
            key = f"{self.launch.pipeline}/@calibrate/{self.launch.host}/{item.name}"
            self.bus.serve_told(key, partial(self._calibrate, node))
        for port, edge in item.inputs.items():
            if edge.key in self.graph.sent:
                continue  # a neighbour in this process hands it over directly
            inlet = Inlet(
                edge.key,
                type(node).inputs()[port].message,
                edge.max_age,
                self.clock,
                node.context.reject,
                self.graph.ports[item.name, port],
                self._is_neighbour if port in item.guarded else anybody,
            )
            if marks is not None and port in item.guarded:
                self.missed.hold(inlet, marks.get(edge.key, 0))
            self.status.watch(item.name, inlet)
            if port in item.guarded:
                self.bus.subscribe_directly(edge.key, Edge(self.intake, inlet, edge.queue).arrive)
            else:  # whoever sends may send a flood: the ring thins it out before Python sees it
                self.bus.subscribe_from(edge.key, edge.queue, self._taker(inlet))

    def _is_neighbour(self, source: str) -> bool:
        return source in self.bus.neighbours()

    def _taker(self, inlet: Inlet[Any]) -> Any:
        lock, take = self.lock, inlet.take

        def taker(source: str, data: bytes) -> None:
            with lock:
                take(data, source)

        return taker

    def _calibrate(self, node: Node[Any], data: bytes) -> bytes:
        try:
            with self.lock:
                before = node.calibrate(data)
        except ValueError as error:
            return json.dumps({"refused": str(error)}).encode()
        return json.dumps(before._asdict()).encode()

    def _handler_failed(self, name: str, message: Message, error: Exception) -> None:
        self._tell(name, error, f" at {message}")
        if self.graph.failing[name] >= MAX_FAILURES:
            self.keepsakes[name].forget()
            self._give_up(name, f"{MAX_FAILURES} exceptions in a row, the last {error!r}")

    def _ticking_failed(self, node: Node[Any], error: BaseException, in_a_row: int) -> None:
        self._tell(node.context.name, error, "")
        if isinstance(error, SystemExit) or in_a_row >= MAX_FAILURES:
            self._give_up(node.context.name, str(error), getattr(error, "code", EX_SOFTWARE))

    def _tell(self, name: str, error: BaseException, where: str) -> None:
        """An exception with its way through the program, once for each place that raises it.

        How many there are of it is said once a second, as EXCEPTIONS.
        """
        import traceback

        *_, (frame, line) = traceback.walk_tb(error.__traceback__)
        place = (name, frame.f_code.co_filename, line, type(error).__name__)
        if place not in self._raised:
            self._raised.add(place)
            text = "".join(traceback.format_exception(error)).rstrip()
            print(f"EXCEPTION {name}: {error!r}{where}\n{text}", file=sys.stderr, flush=True)

    def _give_up(self, name: str, why: str, code: Any = EX_SOFTWARE) -> None:
        if self.failed.is_set():
            return  # what still came in meanwhile
        print(f"GIVING_UP {name}: {why}", file=sys.stderr, flush=True)
        self.exit_code = code if isinstance(code, int) else EX_SOFTWARE
        self.failed.set()

    exit_code = 0

    def run(self) -> int:
        """Serve until told to stop; the exit code."""
        notifier = Notifier()
        orders = Orders()
        notifier.send("READY=1")
        linked, started = False, time.monotonic()
        expected = None
        next_status = _first_status(started)
        idle_code: IdleCode | None = None
        while not (orders.stop or self.failed.is_set()):
            # While wires are being laid, look often: the whole pipeline waits for the last one.
            laying = (not linked and time.monotonic() - started < LAYING_S) or bool(self.missed)
            orders.wait(0.01 if laying else (next_status - time.monotonic()) % BEAT_S)
            if not linked and self._linked():
                linked = True
                notifier.send("LINKED=1")
            if self.missed.due():
                self._catch_up()
            if orders.epoch is not None:
                self.host_clock.follow(orders.epoch)
                orders.epoch = None
            if orders.go:
                orders.go = False
                expected = time.monotonic()
                idle_code = IdleCode(expected)
                for ticker in self.tickers:
                    ticker.start()
            if self._beats():
                notifier.send("WATCHDOG=1")
            if time.monotonic() >= next_status:
                next_status += STATUS_S
                self._report(notifier)
                if expected is not None:
                    self._mind_silence(expected)
                if idle_code is not None:
                    idle_code.look(time.monotonic())
            else:
                self.status.pack_many()
        notifier.send("STOPPING=1")
        self._close()
        return self.exit_code

    def _catch_up(self) -> None:
        unheard = self.missed.unheard()
        count = self.missed.catch_up(self.bus.ask, self.lock, self.status.mute)
        rest = f"; nothing new of {', '.join(unheard)}" if unheard else ""
        if self.missed.gone:
            rest += f"; not all of {', '.join(self.missed.gone)}, nobody keeps so many"
        text = f"CAUGHT_UP with {count} samples of the time between{rest}"
        print(text, file=sys.stderr, flush=True)

    def _report(self, notifier: Notifier) -> None:
        """The status on the bus, in a word to the supervisor, and what is new of it on the log."""
        self.status.send(self.clock.now())
        notifier.send(f"STATUS={self.status.text()}")
        for line in self.gossip.news(self.status.complaints, time.monotonic()):
            print(line, file=sys.stderr, flush=True)

    def _mind_silence(self, since: float) -> None:
        """End if a node that is to be started again when it is silent, is."""
        for item in self.launch.nodes:
            if item.restart_on_silence and self.status.silence(item.name, since) > SILENCE_S:
                self.keepsakes[item.name].forget()
                self._give_up(item.name, f"nothing sent for {SILENCE_S:g} s")

    def _linked(self) -> bool:
        waited = [item.outputs[port] for item in self.launch.nodes for port in item.awaited]
        enough = self.bus.peers() >= self.launch.neighbours
        return enough and all(self.publishers[key].watched for key in waited)

    def _beats(self) -> bool:
        """Whether the work goes on: the lock is not held for long, and drivers tick."""
        if not self.lock.acquire(timeout=BEAT_S):
            return False
        states: list[tuple[Keepsake, bytes]] = []
        try:
            if not self.missed:
                for name, keepsake in self.keepsakes.items():
                    marks = {i.key: i.newest for i in self.status.inlets(name)}
                    states.append((keepsake, keepsake.look(marks)))
        finally:
            self.lock.release()
        for keepsake, state in states:
            keepsake.store(state)
        working = self.bus.alive() and self.intake.alive()
        return working and all(ticker.alive() for ticker in self.tickers)

    def _close(self) -> None:
        for ticker in self.tickers:
            ticker.stop()
        if self.lock.acquire(timeout=BEAT_S):
            with contextlib.suppress(Exception):
                self.graph.close()
            self.lock.release()
        self.bus.close()


def _first_status(started: float) -> float:
    """When to report for the first time [s], and every second from then on.

    In turns: what all processes of a pipeline do at once holds their samples up for milliseconds.
    Those that were started in a row have numbers in a row, and multiples of the golden ratio lie
    apart whatever number they begin with.
    """
    turn, earliest = os.getpid() * GOLDEN * STATUS_S, started + 0.5 * STATUS_S
    return earliest + (turn - earliest) % STATUS_S


def _make_node(item: NodeLaunch, kind: type[Node[Any]], folder: Path) -> Node[Any]:
    params, problems = build(kind.params_type(), item.params)
    if problems:
        print(f"CONFIG {item.name}: {problems[0].text}", file=sys.stderr, flush=True)
        sys.exit(EX_CONFIG)
    try:
        return kind(params, Context(name=item.name, run_folder=folder))
    except Exception as error:
        code = EX_DEVICE if isinstance(error, OSError) else getattr(error, "exit_code", None)
        if code is None:
            raise
        print(f"{item.name}: {error}", file=sys.stderr, flush=True)
        sys.exit(code)


def main(types: Mapping[str, type[Node[Any]]] | None = None) -> None:
    """Be the process that LODELINE_LAUNCH describes, and exit."""
    text = os.environ.get(VARIABLE)
    if text is None:
        print("this is a node: it runs in a pipeline, see `lodeline up --help`", file=sys.stderr)
        sys.exit(EX_USAGE)
    launch = Launch.from_json(text)
    sys.setswitchinterval(1e-4)  # a waiting thread gets the interpreter soon
    process = NodeProcess(
        launch, types or {item.name: load_node(Path(item.run)) for item in launch.nodes}
    )
    settle()
    code = process.run()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # zenoh's threads must not hold the exit


def run(kind: type[Node[Any]]) -> None:
    """Run a node program: `if __name__ == "__main__": run(Attitude)`."""
    text = os.environ.get(VARIABLE)
    names = [item.name for item in Launch.from_json(text).nodes] if text else []
    main(dict.fromkeys(names, kind))


if __name__ == "__main__":
    main()
