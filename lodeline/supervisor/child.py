"""One process and its states, from its first start to its end.

starting -> ready -> running           (READY, then `go`)
starting, ready, running -> hung       (no word in time: SIGABRT, then SIGKILL)
any of these -> waiting -> starting    (it died and is started again)
             -> done, failed           (it ended well, or is given up)
             -> stopping -> stopped    (SIGTERM, then SIGKILL)
"""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lodeline.memory import resident
from lodeline.supervisor.backoff import Backoff
from lodeline.supervisor.groups import Groups
from lodeline.supervisor.logs import Console
from lodeline.supervisor.notify import NotifySocket
from lodeline.supervisor.plan import Plan, Timing
from lodeline.supervisor.process import Process
from lodeline.supervisor.schedule import grant
from lodeline.supervisor.usage import Usage

State = Literal[
    "starting", "ready", "running", "hung", "waiting", "done", "failed", "stopping", "stopped"
]
ALIVE = ("starting", "ready", "running", "hung", "stopping")
OVER = ("done", "failed", "stopped")

NEAR = 0.8
"""Of the memory that a process may take: at this part of it a word is said."""
EX_USAGE, EX_DEVICE, EX_OSERR, EX_CONFIG = 64, 69, 71, 78
DEVICE_WAIT_S = 2.0
"""A wrong chip is not the right one a moment later."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What all children of a supervisor share. `changed` is called at each change of state."""

    timing: Timing
    console: Console
    groups: Groups
    environment: dict[str, str]
    prefix: tuple[str, ...]
    uniform: Callable[[float, float], float]
    changed: Callable[[], None]


class Child:
    """A process that is kept alive. All but `describe` belongs to the event loop's thread."""

    def __init__(self, plan: Plan, notify: Path, around: Surroundings) -> None:
        self.plan = plan
        self.state: State = "waiting"
        self.linked = False
        self.released = False
        self.restarts = 0
        self.last_exit = ""
        self.status = ""
        self.scheduling = ("", "")
        self.usage = Usage()
        self._heavy = False
        self.since = time.monotonic()
        self._around = around
        self._backoff = Backoff(plan.restart, around.timing.backoff, around.uniform)
        self._notify = NotifySocket(notify)
        self._stop = asyncio.Event()
        self._called = asyncio.Event()  # to stop or to start again, while nothing lives
        self._asked = False
        self._due = 0.0
        self._ready_at: float | None = None
        self._process: Process | None = None
        self._tail: list[str] = []

    @property
    def pid(self) -> int | None:
        """Its process id while it lives."""
        return None if self._process is None else self._process.pid

    @property
    def alive(self) -> bool:
        return self.state in ALIVE

    async def keep(self) -> None:
        """Start it, and start it again, until it is done, given up or stopped."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._notify.fileno(), self.listen)
        try:
            while not self._stop.is_set():
                delay = self._judge(await self._live())
                if delay is None:
                    if not await self._recalled():
                        return
                    self.restarts += 1
                    continue
                try:
                    await asyncio.wait_for(self._stop.wait(), delay)
                except TimeoutError:
                    self.restarts += 1
            self._become("stopped")
        finally:
            loop.remove_reader(self._notify.fileno())
            self._notify.close()

    async def _recalled(self) -> bool:
        """Wait while it is over, until all stops or somebody wants it again."""
        if not self._stop.is_set():
            await self._called.wait()
            self._called.clear()
        return not self._stop.is_set()

    def restart(self) -> str:
        """Start it again because somebody asked for it; what comes of that, in words."""
        if self.state in ("done", "failed"):
            self._called.set()
        elif self.state in ("starting", "ready", "running"):
            self._asked = True
            self.terminate()
        else:
            return f"is {self.state} already"
        self._event(f"RESTART {self.plan.name}: asked for")
        return "restarting"

    def listen(self) -> None:
        """Take in what it said."""
        for name, value in self._notify.words(self.pid or 0):
            if name == "READY" and self.state == "starting":
                self._ready_at = time.monotonic()
                self._due = self._ready_at + self._around.timing.watchdog
                self._become("ready")
                if self.released:
                    self.release()
            elif name == "LINKED" and not self.linked:
                self.linked = True
                self._around.changed()
            elif name == "WATCHDOG" and self.state in ("ready", "running"):
                self._due = time.monotonic() + self._around.timing.watchdog
            elif name == "STATUS":
                self.status = value

    def release(self) -> None:
        """Let its sources go, now or as soon as it is ready."""
        self.released = True
        if self.state == "ready" and self._process is not None:
            self._process.tell("go")
            self._become("running")

    def tell(self, order: str) -> None:
        """A line on its standard input, if it lives."""
        if self._process is not None:
            self._process.tell(order)

    def check(self, now: float) -> None:
        """See whether it is late with something, and act."""
        if not self.alive:
            return
        self._weigh()
        if now < self._due:
            return
        timing, name = self._around.timing, self.plan.name
        if self.state == "starting":
            self._abort(f"NOT_READY {name} after {timing.ready:g} s: aborted")
        elif self.state in ("ready", "running"):
            self._abort(f"NODE_SILENT {name} for {timing.watchdog:g} s: aborted")
        else:
            if self.state == "stopping":
                self._event(f"KILLED {name}: still there {timing.grace:g} s after SIGTERM")
            self.kill()
            self._due = now + timing.grace

    def excuse(self, seconds: float) -> None:
        """The supervisor itself was held up for so long: wait that much longer."""
        self._due += seconds

    def forbid(self) -> None:
        """Do not start it any more."""
        self._stop.set()
        self._called.set()

    def terminate(self) -> None:
        """Ask it to end: SIGTERM to its group, which is woken up if somebody stopped it."""
        if self.alive:
            self._due = time.monotonic() + self._around.timing.grace
            self._become("stopping")
            self._signal_group(signal.SIGTERM)
            self._signal_group(signal.SIGCONT)

    def kill(self) -> None:
        """End its whole group now."""
        self._signal_group(signal.SIGKILL)

    async def _live(self) -> int:
        """From start to exit; the exit code, or minus the signal that ended it."""
        self.linked = False
        self.status = ""
        self._ready_at = None
        try:
            process = self._spawn()
        except OSError as error:
            self._event(f"CANNOT_START {self.plan.name}: {error}")
            return EX_OSERR
        try:
            await process.ended()
            self.listen()  # what it said last
        finally:
            code = process.bury()
            self._tail = list(process.log.tail)
            self._process = None
            self._around.groups.discard(process.pid)
        return code

    def _spawn(self) -> Process:
        plan, around = self.plan, self._around
        words = {"LODELINE_LAUNCH": plan.launch(self.restarts)}
        words["NOTIFY_SOCKET"] = str(self._notify.path)
        self._process = process = Process(
            [*around.prefix, *plan.command],
            around.environment | words,
            lambda text: around.console.line(plan.name, text),
        )
        around.groups.add(process.pid)
        self.scheduling = grant(process.pid, plan)
        if self.scheduling[1] and self.restarts == 0:
            self._event(f"NOT_GRANTED {plan.name}: {self.scheduling[1]}")
        self.usage = Usage()
        self._heavy = False
        self.since = time.monotonic()
        self._due = self.since + around.timing.ready
        self._become("starting")
        return process

    def _judge(self, code: int) -> float | None:
        """What an exit means: seconds until the next start, or None."""
        self.last_exit = word_of(code)
        now, name = time.monotonic(), self.plan.name
        if self._stop.is_set():
            self._become("stopped")
            return None
        if self._asked:
            self._asked = False
            self._become("waiting")
            return 0.0
        if code == 0:
            self._event(f"NODE_DONE {name}")
            self._become("done")
            return None
        ready_for = 0.0 if self._ready_at is None else now - self._ready_at
        permanent = code in (EX_USAGE, EX_CONFIG)
        delay = None if permanent else self._backoff.after_exit(now, ready_for)
        if delay is not None and code == EX_DEVICE:
            delay = max(delay, DEVICE_WAIT_S)
        if delay is None:
            if permanent:  # what it was launched with is read when the pipeline is started
                why = "not started again: mend it, stop the pipeline and start it again"
            else:
                why = (
                    f"given up after start {self.restarts + 1}: mend it, `lodeline restart {name}`"
                )
            self._event(f"NODE_FAILED {name}: {self.last_exit}, {why}", self._tail)
            self._become("failed")
            return None
        when = f"in {delay:.1f} s" if delay else "at once"
        text = f"NODE_EXIT {name}: {self.last_exit}, restart {self.restarts + 1} {when}"
        self._event(text, self._tail)
        self._become("waiting")
        return delay

    def _abort(self, text: str) -> None:
        self._event(text)
        self._due = time.monotonic() + self._around.timing.abort
        self._become("hung")
        if self._process is not None:
            self._process.abort()

    def _signal_group(self, number: int) -> None:
        if self._process is not None:
            self._process.signal_group(number)

    def sample(self, now: float) -> None:
        """Once a second: what it costs, and what of its log was dropped."""
        if self._process is not None:
            self.usage.sample(self._process.pid, now)
            self._process.log.report_dropped()

    def _weigh(self) -> None:
        """Kill it if it takes more memory than it may; say so when that comes near."""
        limit, name = self.plan.memory, self.plan.name
        if limit is None or (rss := resident(self.pid or 0)) <= NEAR * limit:
            return
        has = f"{name}: {rss / 1e6:.0f} MB of {limit / 1e6:.0f} allowed by rss_mb"
        if rss > limit:
            self._event(f"RSS {has}: killed")
            self.kill()
        elif not self._heavy:
            self._heavy = True
            self._event(f"RSS_HIGH {has}")

    def describe(self, now: float) -> dict[str, object]:
        """Its state as plain values; may be called from any thread."""
        granted, refused = self.scheduling
        return {
            "process": self.plan.name,
            "host": self.plan.host,
            "nodes": list(self.plan.nodes),
            "state": self.state,
            "pid": self.pid,
            "restarts": self.restarts,
            "last_exit": self.last_exit,
            "uptime": round(now - self.since, 3) if self.alive else None,
            "cpu": round(self.usage.cpu, 4) if self.alive else None,
            "rss": self.usage.rss if self.alive else None,
            "scheduling": granted,
            "refused": refused,
            "status": self.status,
        }

    def _event(self, text: str, tail: list[str] | None = None) -> None:
        self._around.console.event(text)
        for line in tail or ():
            self._around.console.event(f"  {self.plan.name} said: {line}")

    def _become(self, state: State) -> None:
        self.state = state
        self._around.changed()


def word_of(code: int) -> str:
    """An exit code in words: `exit 70`, `SIGKILL`."""
    if code >= 0:
        return f"exit {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
