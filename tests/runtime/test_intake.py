"""Claims about the way from the bus to a handler: short if it holds nobody up, never unordered."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from queue import Queue

import pytest

from lodeline.clock import HostClock, epoch_offset
from lodeline.inlet import Inlet
from lodeline.intake import QUICK_S, Edge, Intake
from lodeline_msgs import WheelTicks, pack

PATIENCE_S = 10.0


class Line:
    """One edge, and a thread of the bus: the test's own. `taken` has (number, thread)."""

    def __init__(self, queue: int = 64) -> None:
        self.lock = threading.RLock()
        self.taken: Queue[tuple[int, int]] = Queue()
        self.asked: list[int] = []
        self.work: Callable[[], None] = lambda: None
        clock = HostClock(epoch_offset())
        self.inlet = Inlet("wheels", WheelTicks, None, clock, print, self._handle, self._may_send)
        self.intake = Intake(self.lock)
        self.edge = Edge(self.intake, self.inlet, queue)
        self.sent = 0

    def _handle(self, ticks: WheelTicks) -> None:
        self.work()
        self.taken.put((ticks.seq, threading.get_ident()))

    def _may_send(self, _source: str) -> bool:
        self.asked.append(threading.get_ident())
        return True

    def send(self, source: str = "a") -> None:
        self.edge.arrive(source, pack(WheelTicks(self.sent + 1, 0, 0, seq=self.sent)))
        self.sent += 1

    def warm(self) -> None:
        """Until samples go the short way."""
        for _ in range(1000):
            self.send()
            if self.next()[1] == threading.get_ident():
                return
            time.sleep(QUICK_S)
        raise AssertionError("no sample was handled in the thread that brought it")

    @contextlib.contextmanager
    def elsewhere(self) -> Iterator[None]:
        """While another handler of the process runs."""
        begun, over = threading.Event(), threading.Event()

        def run() -> None:
            with self.lock:
                begun.set()
                over.wait(PATIENCE_S)

        other = threading.Thread(target=run)
        other.start()
        assert begun.wait(PATIENCE_S)
        try:
            yield
        finally:
            over.set()
            other.join()

    def next(self) -> tuple[int, int]:
        return self.taken.get(timeout=PATIENCE_S)


def test_a_sample_that_holds_nobody_up_is_handled_in_the_thread_that_brought_it() -> None:
    line = Line()
    line.warm()
    assert line.inlet.lost == 0


def test_whether_a_sender_may_send_is_never_asked_in_the_thread_of_the_bus() -> None:
    line = Line()
    line.warm()
    line.send("b")
    line.next()
    assert len(line.asked) == 2
    assert threading.get_ident() not in line.asked


def test_while_a_handler_runs_the_bus_goes_on_and_the_newest_are_kept() -> None:
    line = Line(queue=3)
    line.warm()
    first = line.sent
    busy, done = threading.Event(), threading.Event()

    def work() -> None:
        busy.set()
        assert done.wait(PATIENCE_S)

    with line.elsewhere():
        line.work = work
        line.send()
    assert busy.wait(PATIENCE_S)
    for _ in range(10):
        line.send()  # returns, though the handler does not
    done.set()
    assert [line.next()[0] - first for _ in range(4)] == [0, 8, 9, 10]
    assert line.inlet.lost == 7


def test_a_slow_handler_is_left_to_the_other_thread_until_it_is_quick_again() -> None:
    line = Line()
    line.warm()
    line.work = lambda: time.sleep(2 * QUICK_S)
    line.send()  # whoever takes this one finds that it is slow
    line.next()
    line.send()
    assert line.next()[1] != threading.get_ident()
    line.work = lambda: None
    line.warm()


def test_the_bus_has_as_much_time_for_itself_as_its_thread_lends() -> None:
    line = Line()
    line.warm()
    line.work = lambda: time.sleep(0.5 * QUICK_S)
    for _ in range(2):  # at once: the second finds the thread of the bus lent out for long enough
        line.send()
    threads = [line.next()[1] for _ in range(2)]
    assert threads[1] != threading.get_ident()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("short", [True, False])
def test_a_handler_that_ends_its_thread_ends_the_intake(short: bool) -> None:
    line = Line()
    line.warm()

    def work() -> None:
        line.taken.put((0, threading.get_ident()))
        raise SystemExit(1)

    line.work = work
    time.sleep(QUICK_S)
    with contextlib.suppress(SystemExit), contextlib.nullcontext() if short else line.elsewhere():
        line.send()
    line.next()
    end = time.monotonic() + PATIENCE_S
    while line.intake.alive() and time.monotonic() < end:
        time.sleep(1e-3)
    assert not line.intake.alive()


def test_no_sample_overtakes_another_whichever_way_each_goes() -> None:
    line = Line(queue=4096)
    line.warm()
    first = line.sent
    stop = threading.Event()

    def disturb() -> None:  # other handlers of the process
        while not stop.is_set():
            with line.lock:
                time.sleep(1e-4)
            time.sleep(1e-4)

    other = threading.Thread(target=disturb)
    other.start()
    for _ in range(2000):
        line.send()
    stop.set()
    other.join()
    taken = [line.next() for _ in range(2000)]
    assert [number for number, _ in taken] == list(range(first, first + 2000))
    assert line.inlet.lost == 0
    assert line.intake.alive()


def test_a_handler_that_is_too_slow_for_good_has_as_many_turns_as_samples_that_wait() -> None:
    line = Line(queue=4)
    with line.elsewhere():
        for _ in range(1000):
            line.send()
        assert line.intake.turns.qsize() <= 4
    assert [line.next()[0] for _ in range(4)] == [996, 997, 998, 999]
    line.send()  # and the next has its turn again
    assert line.next()[0] == 1000
