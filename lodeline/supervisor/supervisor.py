"""The supervisor itself: all processes of a pipeline on this machine, from start to stop."""

from __future__ import annotations

import asyncio
import os
import random
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from lodeline.supervisor.child import OVER, Child, Surroundings
from lodeline.supervisor.environment import death_signal_prefix, environment
from lodeline.supervisor.groups import Groups
from lodeline.supervisor.logs import Console
from lodeline.supervisor.plan import Plan, Timing

EXIT_FINE, EXIT_NODE_DIED, EXIT_INTERRUPTED = 0, 5, 130
HELD_UP_S = 0.3
SAMPLE_S = 1.0
ANSWER_S = 2.0


class Supervisor:
    """Runs plans in a run folder: `asyncio.run(Supervisor(...).run())`, in the main thread.

    `on_release()` is called once, when the sources are let go; `on_beat()` once a second, as long
    as the loop turns; `marks` are starts of environment entries by which the guard knows whatever
    belongs to this run.
    """

    def __init__(
        self,
        plans: Sequence[Plan],
        folder: Path,
        console: Console,
        marks: Sequence[str] = (),
        timing: Timing | None = None,
        on_release: Callable[[], None] = lambda: None,
        on_beat: Callable[[], None] = lambda: None,
    ) -> None:
        self._plans = plans
        self._folder = folder
        self._console = console
        self._timing = timing or Timing()
        self._on_release = on_release
        self._on_beat = on_beat
        self._environment = environment(os.environ)
        self.groups = Groups(marks, self._environment, console.event)
        self.children: list[Child] = []
        self._started = time.monotonic()
        self._changed = asyncio.Event()
        self._over: asyncio.Future[int] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    async def run(self, seconds: float | None = None) -> int:
        """Start all, keep all alive, stop all; the exit code.

        Ends `seconds` after the release, by SIGTERM or SIGHUP (code 0), by SIGINT (130), when a
        required process has failed (5), or when none is left (0, or 5 if one of them failed).
        """
        self._loop = loop = asyncio.get_running_loop()
        self._started = time.monotonic()
        self._over = loop.create_future()
        self._listen_to_signals(loop)
        self.groups.start()
        self.children = self._make_children()
        lives = [asyncio.create_task(child.keep()) for child in self.children]
        release = asyncio.create_task(self._release(seconds))
        tasks = [asyncio.create_task(self._tick()), release, *lives]
        for task in tasks:
            task.add_done_callback(self._task_ended)
        try:
            code = await self._over
            release.cancel()
            await self._stop(lives)
        finally:
            for task in tasks:
                task.cancel()  # a life that is cancelled takes its process with it
            await asyncio.gather(*tasks, return_exceptions=True)
            self.groups.close()
        return code

    def _make_children(self) -> list[Child]:
        around = Surroundings(
            timing=self._timing,
            console=self._console,
            groups=self.groups,
            environment=self._environment,
            prefix=death_signal_prefix(),
            uniform=random.uniform,
            changed=self._change,
        )
        return [
            Child(plan, self._folder / f"notify{i}", around) for i, plan in enumerate(self._plans)
        ]

    def report(self) -> dict[str, Any]:
        """All processes as plain values, for `lodeline ps`; may be called from any thread."""
        now = time.monotonic()
        return {
            "pid": os.getpid(),
            "uptime": round(now - self._started, 3),
            "processes": [child.describe(now) for child in self.children],
        }

    def restart(self, node: str) -> str:
        """Start the process of a node again; what comes of it. From any other thread."""
        answer: Future[str] = Future()
        children = [child for child in self.children if node in child.plan.nodes]
        if not children or self._loop is None or self._loop.is_closed():
            return "is not running"
        self._loop.call_soon_threadsafe(lambda: answer.set_result(children[0].restart()))
        try:
            return answer.result(ANSWER_S)
        except TimeoutError:
            return f"was asked for, but the supervisor has been busy for {ANSWER_S:g} s"

    def tell_all(self, order: str) -> None:
        """A line for every process; may be called from any thread once `run` has begun."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._tell_all, order)

    def _tell_all(self, order: str) -> None:
        for child in self.children:
            child.tell(order)

    def _listen_to_signals(self, loop: asyncio.AbstractEventLoop) -> None:
        loop.add_signal_handler(signal.SIGINT, self._interrupt)
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) != signal.SIG_IGN:  # nohup means it
                loop.add_signal_handler(number, self._end, EXIT_FINE)

    def _interrupt(self) -> None:
        if self._over is not None and self._over.done():
            self._console.event("KILLED all: interrupted twice")
            for child in self.children:
                child.kill()
        self._end(EXIT_INTERRUPTED)

    def _end(self, code: int) -> None:
        if self._over is not None and not self._over.done():
            self._over.set_result(code)

    def _task_ended(self, task: asyncio.Task[None]) -> None:
        """A bug of ours must end the run, not leave it half alive."""
        if task.cancelled() or self._over is None or self._over.done():
            return
        if error := task.exception():
            self._over.set_exception(error)

    def _change(self) -> None:
        self._changed.set()
        if any(child.state == "failed" and child.plan.required for child in self.children):
            self._end(EXIT_NODE_DIED)
        elif all(child.state in OVER for child in self.children):
            failed = any(child.state == "failed" for child in self.children)
            self._end(EXIT_NODE_DIED if failed else EXIT_FINE)

    async def _release(self, seconds: float | None) -> None:
        """Let the sources go when every wire is laid, or when it has taken too long."""
        try:
            async with asyncio.timeout(self._timing.link):
                while self._unlinked():
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            missing = ", ".join(self._unlinked())
            self._console.event(f"NOT_LINKED {missing}: going on after {self._timing.link:g} s")
        for child in self.children:
            child.release()
        self._on_release()
        if seconds is not None:
            await asyncio.sleep(seconds)
            self._end(EXIT_FINE)

    def _unlinked(self) -> list[str]:
        return [
            f"{child.plan.name} ({child.state})"
            for child in self.children
            if not (child.linked and child.state == "ready") and child.state not in OVER
        ]

    async def _tick(self) -> None:
        timing = self._timing
        expected = time.monotonic()
        sampled = 0.0
        while True:
            expected = max(expected + timing.tick, time.monotonic())
            await asyncio.sleep(expected - time.monotonic())
            now = time.monotonic()
            for child in self.children:
                # Whatever stopped or starved us may have done the same to them.
                if now - expected > HELD_UP_S:
                    child.excuse(now - expected)
                child.check(now)
            if now - sampled >= SAMPLE_S:
                sampled = now
                self._on_beat()
                for child in self.children:
                    child.sample(now)

    async def _stop(self, lives: list[asyncio.Task[None]]) -> None:
        """Sources first, so that what is under way is still used, and whoever writes it last."""
        for child in self.children:
            child.forbid()
        share = self._timing.order / max(1, len(lives))
        for child, life in zip(self.children, lives, strict=True):
            child.terminate()
            await asyncio.wait([life], timeout=share)
        if lives:  # a host without nodes is a window
            await asyncio.wait(lives)
