"""The bus: everything that Lodeline asks of zenoh, and the only file that imports it.

Who takes part in it, and how they find each other, is in `sessions`.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from typing import Any

# One runtime thread in place of nine: a quarter less latency and CPU per hop. Safe because
# nothing of ours blocks it: a subscriber reads from a ring in a thread of its own, or is an edge
# of the intake, which lends it to handlers that are quick.
os.environ.setdefault(
    "ZENOH_RUNTIME",
    "(rx: (handover: app), acc: (handover: app), tx: (handover: app), net: (handover: app))",
)

import zenoh

_RUNTIME = "ZENOH_RUNTIME"
MAX_MESSAGE = 1 << 20
LEASE_MS = 3000
PATIENCE_US = 1_000_000
"""What zenoh itself says of keys and readers waits so long for room on a link, then closes it."""
KEEPER_BEAT_S = 5.0

LARGE = 8192
"""Bytes from which a sample has a queue of its own, lest it fill that of the small ones."""


class BusError(RuntimeError):
    """The bus cannot be reached or opened."""


class Publisher:
    """One key to write to. `watched` says whether anyone listens: if not, do not even pack."""

    def __init__(self, session: zenoh.Session, key: str, encoding: str) -> None:
        self.key = key
        self.watched = False
        self.on_watched: Callable[[], None] = _nothing
        self._session = session
        self._large = False
        self._publisher = session.declare_publisher(
            key,
            encoding=zenoh.Encoding(encoding),
            congestion_control=zenoh.CongestionControl.DROP,
        )
        self._source = zenoh.SourceInfo(self._publisher.id, 0)
        self._lock, self._told = threading.Lock(), False
        self._listener = self._publisher.declare_matching_listener(
            zenoh.handlers.Callback(self._matching, indirect=False)
        )
        status: Any = self._publisher.matching_status  # zenoh's own stub calls it a bool
        with self._lock:
            if not self._told:  # else that came while we asked, and is newer
                self.watched = status.matching

    def put(self, data: bytes) -> None:
        """Send; never blocks, drops where a listener cannot follow."""
        self._large |= len(data) >= LARGE
        if not self._large:  # from the first large one on all: none overtakes another of its key
            self._publisher.put(data, source_info=self._source)
            return
        self._session.put(
            self.key,
            data,
            encoding=self._publisher.encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
            source_info=self._source,
        )

    def _matching(self, status: zenoh.MatchingStatus) -> None:
        with self._lock:
            self.watched, self._told = status.matching, True
        self.on_watched()


class Session:
    """A place on the bus, closed with `close`: publishers, rings, queries."""

    def __init__(self, config: dict[str, Any]) -> None:
        made = zenoh.Config()
        for key, value in (_COMMON | config).items():
            made.insert_json5(key, json.dumps(value))
        try:
            self._session = zenoh.open(made)
        except zenoh.ZError as error:
            raise BusError(str(error)) from None
        self._threads: list[threading.Thread] = []
        self._kept: list[Any] = []
        self._queries: SimpleQueue[Question | None] | None = None

    def publisher(self, key: str, encoding: str) -> Publisher:
        """A publisher that drops rather than blocks."""
        return Publisher(self._session, key, encoding)

    def keeper(self, key: str, encoding: str) -> Callable[[bytes], None]:
        """A put function whose last value also reaches those who come later (`subscribe_kept`)."""
        publisher = zenoh.ext.declare_advanced_publisher(
            self._session,
            key,
            encoding=zenoh.Encoding(encoding),
            congestion_control=zenoh.CongestionControl.DROP,
            cache=zenoh.ext.CacheConfig(max_samples=1),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=KEEPER_BEAT_S
            ),
            publisher_detection=True,
        )
        self._kept.append(publisher)
        return publisher.put

    def subscribe(self, key: str, queue: int, take: Callable[[str, bytes, str], None]) -> None:
        """Call `take(key, data, encoding)` for each sample, in a thread of its own.

        At most `queue` samples wait; when `take` is slower than the key, the oldest go.
        """
        subscriber = self._session.declare_subscriber(key, zenoh.handlers.RingChannel(queue))
        self._receive(key, subscriber, _with_put(take))

    def subscribe_from(self, key: str, queue: int, take: Callable[[str, bytes], None]) -> None:
        """As `subscribe`, but calls `take(source, data)`: the sender's `Session.id`, or "".

        What a sender says of itself guards against mistakes, not against malice.
        """
        subscriber = self._session.declare_subscriber(key, zenoh.handlers.RingChannel(queue))
        taker = _with_source(take)

        def run() -> None:
            for sample in _samples(subscriber):
                taker(sample)

        self._listen(key, subscriber, run)

    def subscribe_directly(self, key: str, take: Callable[[str, bytes], None]) -> None:
        """As `subscribe_from`, but in zenoh's own thread, the only one it has.

        So `take` returns soon and waits for nothing. A flood is not thinned out before it comes.
        """
        taker = _with_source(take)

        def run(sample: zenoh.Sample) -> None:
            if not _THREAD.known:
                _THREAD.settle()
            taker(sample)

        handler = zenoh.handlers.Callback(run, indirect=False)
        self._kept.append(self._session.declare_subscriber(key, handler))

    def subscribe_kept(self, key: str, take: Callable[[str, bytes, str], None]) -> None:
        """As `subscribe`, and the last value of each keeper comes at once."""
        self._receive(key, self._kept_ring(key), _with_put(take))

    def collect_kept(self, key: str) -> Callable[[Callable[[str, bytes, str], None]], None]:
        """As `subscribe_kept`, for who looks now and then: gives what came since to `take`.

        Nothing wakes when a sample comes; at most 256 wait, then the oldest go.
        """
        subscriber = self._kept_ring(key)
        self._kept.append(subscriber)

        def collect(take: Callable[[str, bytes, str], None]) -> None:
            give = _with_put(take)
            with contextlib.suppress(zenoh.ZError):  # the session is closed
                while (sample := subscriber.try_recv()) is not None:
                    give(sample)

        return collect

    def _kept_ring(self, key: str) -> Any:
        return zenoh.ext.declare_advanced_subscriber(
            self._session,
            key,
            zenoh.handlers.RingChannel(256),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        )

    def _receive(self, key: str, subscriber: Any, take: Callable[[zenoh.Sample], None]) -> None:
        def run() -> None:
            for sample in _samples(subscriber):
                take(sample)

        self._listen(key, subscriber, run)

    def _listen(self, key: str, subscriber: Any, run: Callable[[], None]) -> None:
        self._kept.append(subscriber)
        thread = threading.Thread(target=run, name=f"ring {key}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def serve(self, key: str, answer: Callable[[], bytes]) -> None:
        """Answer every query of `key` with what `answer()` returns."""
        self.serve_told(key, lambda _: answer())

    def serve_told(self, key: str, answer: Callable[[bytes], bytes]) -> None:
        """Answer every query of `key` with what `answer(data)` returns, `data` being its own.

        One thread answers them all, in turn.
        """
        if self._queries is None:
            self._queries = SimpleQueue()
            thread = threading.Thread(
                target=_answer, args=(self._queries,), name="answers", daemon=True
            )
            self._threads.append(thread)
            thread.start()
        put = self._queries.put

        def ask(query: zenoh.Query) -> None:
            put((key, query, answer))

        handler = zenoh.handlers.Callback(ask, indirect=False)
        self._kept.append(self._session.declare_queryable(key, handler))

    def ask(
        self, key: str, timeout: float = 1.0, data: bytes = b"", *, behind: bool = False
    ) -> list[tuple[str, bytes]]:
        """All answers (key, data) to a query that holds `data`, at most `timeout` seconds later.

        Question and answers overtake samples on their way, or let all of them pass: `behind`.
        """
        # Two machines that claim one host answer with one key: both are wanted.
        replies = self._session.get(
            key,
            timeout=timeout,
            payload=data or None,
            consolidation=zenoh.ConsolidationMode.NONE,
            # A question that waits for room on a dead link holds whoever sends there for 5 s, and
            # the link stays deaf after its return. Its answer goes as it does.
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.BACKGROUND if behind else zenoh.Priority.INTERACTIVE_HIGH,
        )
        good = [reply.ok for reply in replies if reply.ok is not None]
        return [(str(sample.key_expr), sample.payload.to_bytes()) for sample in good]

    def claim(self, key: str) -> None:
        """Let others see that this session lives, for as long as it does."""
        self._kept.append(self._session.liveliness().declare_token(key))

    def watch_claims(self, key: str, take: Callable[[str, bool], None]) -> None:
        """Call `take(key, there)`, in a thread, for each claim that is there, comes or goes."""
        subscriber = self._session.liveliness().declare_subscriber(
            key, zenoh.handlers.FifoChannel(256), history=True
        )
        self._receive(key, subscriber, lambda sample: take(*_presence(sample)))

    @property
    def id(self) -> str:
        """By which others know what comes from here."""
        return str(self._session.info.zid())

    def neighbours(self) -> set[str]:
        """The `id` of each other process of this host that is linked directly."""
        return {str(zid) for zid in self._session.info.peers_zid()}

    def peers(self) -> int:
        """How many other processes of this host are linked directly."""
        return len(self._session.info.peers_zid())

    def alive(self) -> bool:
        """Whether every receiving thread still runs."""
        return all(thread.is_alive() for thread in self._threads)

    def close(self, timeout: float = 1.0) -> None:
        """Leave the bus; a frozen neighbour can hold zenoh's own close for 10 s, not ours."""
        if self._queries is not None:
            self._queries.put(None)
        closer = threading.Thread(target=self._session.close, daemon=True)
        closer.start()
        closer.join(timeout)
        for thread in self._threads:
            # One that comes back from zenoh while the interpreter ends would abort the process.
            if thread is not threading.current_thread():
                thread.join(timeout)


@contextlib.contextmanager
def several_threads() -> Iterator[None]:
    """Sessions of this process that are opened first in here have zenoh's own number of threads.

    A hub beside a gateway needs them: with one, whoever waits for room on the link waits for
    itself, up to 5 s. What is started later finds the environment as it was.
    """
    one = os.environ[_RUNTIME]
    os.environ[_RUNTIME] = "()"
    try:
        yield
    finally:
        os.environ[_RUNTIME] = one


def overhear_links(take: Callable[[str], None]) -> None:
    """Give each line that zenoh writes when a link cannot be opened to `take`, in a thread.

    It says in no other way why. It writes to standard output, which becomes a pipe to that thread:
    for a process that prints nothing there, once in its life, before its first session.
    """
    if "RUST_LOG" in os.environ:
        return  # somebody reads all this himself
    read, write = os.pipe()
    os.dup2(write, 1)
    os.close(write)
    zenoh.init_log_from_env_or(
        "zenoh_link_tls::unicast=warn,zenoh::net::runtime::orchestrator=debug"
    )

    def run() -> None:
        with os.fdopen(read, errors="replace") as lines:
            for line in lines:
                take(line)

    threading.Thread(target=run, name="zenoh's log", daemon=True).start()


def wait_watched(publishers: list[Publisher], timeout: float) -> list[str]:
    """Wait until all publishers have a listener; the keys that have none after `timeout` s."""
    changed = threading.Event()
    for publisher in publishers:
        publisher.on_watched = changed.set
    end = time.monotonic() + timeout
    while True:
        changed.clear()
        waiting = [publisher.key for publisher in publishers if not publisher.watched]
        if not waiting or not changed.wait(max(0.0, end - time.monotonic())):
            return waiting


_COMMON: dict[str, Any] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": True,
    "scouting/delay": 0,  # a router would wait 0.5 s for answers to questions it never asks
    "adminspace/enabled": False,
    "transport/link/protocols": ["unixsock-stream"],
    "transport/link/tx/lease": LEASE_MS,
    "transport/link/tx/queue/congestion_control/block/wait_before_close": PATIENCE_US,
    "transport/link/rx/max_message_size": MAX_MESSAGE,
    # Saves nothing on samples this small, and takes 16 MB from every process that sends 3 kB once.
    "transport/shared_memory/enabled": False,
    "listen/retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
    "connect/retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
}


class _Thread(threading.local):
    """What is known of the thread that asks."""

    known = False

    def settle(self) -> None:
        """Have the interpreter keep its account of this thread, which is zenoh's, for good.

        Else it opens one for each sample and closes it again, with memory mapped, touched and
        given back: half the CPU of a callback (measured at 1000 Hz: 26 us in place of 53).
        """
        self.known = True
        ctypes.pythonapi.PyGILState_Ensure()  # and no release


_THREAD = _Thread()


def _nothing() -> None:
    """Nobody wants to know yet."""


def _with_put(take: Callable[[str, bytes, str], None]) -> Callable[[zenoh.Sample], None]:
    def taker(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            take(str(sample.key_expr), sample.payload.to_bytes(), str(sample.encoding))

    return taker


def _with_source(take: Callable[[str, bytes], None]) -> Callable[[zenoh.Sample], None]:
    last, name = None, ""  # to write a sender's id out costs more than to compare it

    def taker(sample: zenoh.Sample) -> None:
        nonlocal last, name
        data = sample.payload.to_bytes()
        if data or sample.kind == zenoh.SampleKind.PUT:  # a DELETE carries nothing
            info = sample.source_info
            zid = None if info is None else info.source_id.zid
            if zid != last:
                last, name = zid, "" if zid is None else str(zid)
            take(name, data)

    return taker


Question = tuple[str, zenoh.Query, Callable[[bytes], bytes]]
"""The key that it was put to, itself, and what answers it."""


def _answer(questions: SimpleQueue[Question | None]) -> None:
    """Answer questions until there is a None; an error of ours leaves one without an answer."""
    while (question := questions.get()) is not None:
        key, query, answer = question
        try:
            with query:  # its end tells the asker that nothing more comes
                data = b"" if query.payload is None else query.payload.to_bytes()
                query.reply(key, answer(data))
        except Exception:
            import traceback

            traceback.print_exc()


def _presence(sample: zenoh.Sample) -> tuple[str, bool]:
    return str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT


def _samples(subscriber: Any) -> Iterator[zenoh.Sample]:
    """Samples of a ring until the session closes."""
    try:
        while True:
            yield subscriber.recv()
    except zenoh.ZError:
        return
