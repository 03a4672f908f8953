"""The gateway: serves the page and its WebSocket on loopback, and lets the right token drive."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import time
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from lodeline.dash import web
from lodeline.dash.client import Viewer
from lodeline.dash.frames import RATE_HZ, Past
from lodeline.dash.link import Link

MAX_MESSAGE = 65_536
MAX_VIEWERS = 16
STATUS_S = 1.0
HELD_S = 0.3
"""A robot is stopped when its driver has been silent for so long."""
TOP_SPEED = 0.2  # m/s
TOP_RATE = 1.5  # rad/s


class Gateway:
    """`async with Gateway(name, port) as gateway: ...` serves until it is left.

    `port` is the one it listens on, `token` what a page must say to drive and restart.
    OSError if the port is taken.
    """

    def __init__(self, name: str, port: int = 0) -> None:
        self.port = port
        self.token = secrets.token_urlsafe(24)
        self._link = Link(name, self._link_changed)
        self._past = Past()
        self._viewers: set[Viewer] = set()
        self._number = 0
        self._driver: Viewer | None = None
        self._driven = 0.0
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def url(self) -> str:
        """Where the page is; the token stands behind the `#`, which no browser sends."""
        return f"http://127.0.0.1:{self.port}/#token={self.token}"

    async def __aenter__(self) -> Gateway:
        self._loop = asyncio.get_running_loop()
        self._server: Server = await serve(
            self._serve,
            "127.0.0.1",
            self.port,
            process_request=_screen,
            max_size=MAX_MESSAGE,
            max_queue=16,
            compression=None,
            server_header=None,
            close_timeout=1.0,
        )
        self.port = self._server.sockets[0].getsockname()[1]
        self._link.start()
        self._ticking = asyncio.create_task(self._tick())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._ticking.cancel()
        self._release()
        for viewer in self._viewers:
            viewer.drop()
        self._server.close()
        await asyncio.to_thread(self._link.close)

    async def wait(self) -> None:
        """Until a bug of ours ends the ticking; raises it."""
        await self._ticking

    def _link_changed(self) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is over, and nobody wants to know
            self._loop.call_soon_threadsafe(self._run_changed)

    def _run_changed(self) -> None:
        self._past.frames.clear()
        for viewer in self._viewers:
            if viewer.greeted:
                self._begin_run(viewer, [])

    def _begin_run(self, viewer: Viewer, batches: list[str]) -> None:
        run = self._link.run
        if run is None and not self._link.known:
            return  # it will be known in a moment
        scene = {"t": "gone", "name": self._link.name} if run is None else run.scene
        viewer.begin_run(json.dumps(scene), None if run is None else run.tail, batches)

    async def _tick(self) -> None:
        due = time.monotonic()
        status_due = due
        while True:
            due = max(due + 1.0 / RATE_HZ, time.monotonic())
            await asyncio.sleep(due - time.monotonic())
            now = time.monotonic()
            if self._link.failed is not None:
                raise RuntimeError("the line to the pipeline ended") from self._link.failed
            if self._driver is not None and now - self._driven > HELD_S:
                self._release()
            for viewer in [viewer for viewer in self._viewers if viewer.overdue()]:
                viewer.drop()
            if self._viewers:
                self._link.look()
            run = self._link.run
            if run is None:
                continue
            self._past.frames.append(run.newest.frame(self._number))
            self._number += 1
            status = None
            if now >= status_due:
                status_due = now + STATUS_S
                status = json.dumps(run.status(), separators=(",", ":"))
            calibrating = run.calibrating()
            for viewer in self._viewers:
                viewer.frame_ready()
                if calibrating is not None and viewer.greeted:
                    viewer.post(calibrating)
                if status is not None:
                    viewer.post_status(status)

    async def _serve(self, connection: ServerConnection) -> None:
        if len(self._viewers) >= MAX_VIEWERS:
            await connection.close(1013, f"{MAX_VIEWERS} pages are open already")
            return
        self._link.look()
        viewer = Viewer(connection, self._past)
        self._viewers.add(viewer)
        feeding = asyncio.create_task(viewer.feed())
        try:
            async for text in connection:
                if not self._take(viewer, text):
                    await connection.close(1008, "not a message of the page")
        except ConnectionClosed:
            pass  # a page may leave in any way
        finally:
            self._viewers.discard(viewer)
            feeding.cancel()
            if self._driver is viewer:
                self._release()

    def _take(self, viewer: Viewer, text: str | bytes) -> bool:
        """One message of a page; False if no page of ours would say it."""
        try:
            said = json.loads(text)
        except (ValueError, RecursionError):
            return False
        if not isinstance(said, dict):
            return False
        if "ack" in said:
            number = said["ack"]
            if type(number) is int:
                viewer.confirm(number)
            return type(number) is int
        verb = said.get("do")
        if verb == "hello" and not viewer.greeted:
            self._greet(viewer, said.get("token"))
            return True
        if verb not in ("drive", "restart") or not viewer.greeted:
            return False
        if not viewer.trusted:
            viewer.post(_note("refused: this page only watches"))
            return True
        return self._drive(viewer, said) if verb == "drive" else self._restart(viewer, said)

    def _greet(self, viewer: Viewer, token: Any) -> None:
        given = token if isinstance(token, str) else ""
        viewer.trusted = secrets.compare_digest(given.encode(), self.token.encode())
        viewer.greeted = True
        hello = {"t": "hello", "trusted": viewer.trusted, "speed": TOP_SPEED, "rate": TOP_RATE}
        viewer.post(json.dumps(hello))
        if given and not viewer.trusted:
            viewer.post(_note("this link is an old one: the page only watches"))
        self._begin_run(viewer, self._past.batches(MAX_MESSAGE))
        if run := self._link.run:
            viewer.post_status(json.dumps(run.status(), separators=(",", ":")))

    def _drive(self, viewer: Viewer, said: dict[str, Any]) -> bool:
        """Forward and left as parts of what is allowed, in -1..1."""
        forward, left = _part(said.get("forward")), _part(said.get("left"))
        if forward is None or left is None:
            return False
        if self._driver not in (None, viewer):
            if said.get("done") is not True:
                viewer.post(json.dumps({"t": "refused", "text": "another page is driving"}))
            return True
        if self._driver is None and (run := self._link.run) and run.unheard:
            viewer.post(_note(run.unheard))
        self._driver, self._driven = viewer, time.monotonic()
        self._command(forward * TOP_SPEED, left * TOP_RATE)
        if said.get("done") is True:
            self._driver = None
        return True

    def _release(self) -> None:
        """The dead man's handle: nobody drives any more, so the robot stops."""
        if self._driver is not None:
            self._driver = None
            self._command(0.0, 0.0)

    def _command(self, v: float, w: float) -> None:
        if run := self._link.run:
            run.command(v, w)

    def _restart(self, viewer: Viewer, said: dict[str, Any]) -> bool:
        node, run = said.get("node"), self._link.run
        if not isinstance(node, str) or (run is not None and node not in run.scene["nodes"]):
            return False
        if run is None:
            viewer.post(_note("no pipeline runs"))
            return True

        async def ask() -> None:
            viewer.post(_note(await asyncio.to_thread(run.restart, node)))

        task = asyncio.create_task(ask())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return True


def _screen(_connection: ServerConnection, request: Request) -> Response | None:
    return web.answer(request)


def _part(value: Any) -> float | None:
    """A number, kept within -1..1; None for anything else."""
    if type(value) not in (int, float) or value != value:
        return None
    return float(max(-1, min(1, value)))


def _note(text: str) -> str:
    return json.dumps({"t": "note", "text": text})
