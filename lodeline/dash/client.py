"""One browser at the gateway: what it is owed, what it has confirmed, how long it may dawdle."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections import deque

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from lodeline.dash.frames import Past
from lodeline.dash.tail import Tail

AHEAD = 4
"""Frames that may be on their way: beyond that a client gets none, and later only the newest."""
PATIENCE_S = 10.0
"""A client that confirms nothing for so long is let go."""
MAX_WAITING = 512


class Viewer:
    """A connected page. All of it belongs to the event loop's thread."""

    def __init__(self, connection: ServerConnection, past: Past) -> None:
        self.connection = connection
        self.trusted = False
        self.greeted = False
        self._past = past
        self._sent: deque[int] = deque()
        self._last = -1
        self._heard = time.monotonic()
        self._waiting: deque[str] = deque()
        self._status: str | None = None
        self._tail: Tail | None = None
        self._lines = 0
        self._wake = asyncio.Event()

    def post(self, text: str) -> None:
        """Send a message that must not be left out: a scene, an answer."""
        self._waiting.append(text)
        self._wake.set()

    def post_status(self, text: str) -> None:
        """Send this, unless a newer one comes before its turn."""
        self._status = text
        self._wake.set()

    def frame_ready(self) -> None:
        """There is a newer frame."""
        self._wake.set()

    def begin_run(self, scene: str, tail: Tail | None, batches: list[str]) -> None:
        """Another run is shown from now on: the scene, and what is known of its past."""
        self._status = None
        self._tail, self._lines = tail, 0
        for text in (scene, *batches):
            self.post(text)
        self._last = self._past.frames[-1].number if self._past.frames else -1

    def confirm(self, number: int) -> None:
        """The page has a frame, and with it all before."""
        while self._sent and self._sent[0] <= number:
            self._sent.popleft()
            self._heard = time.monotonic()
        self._wake.set()

    def overdue(self) -> bool:
        """Whether it has been owing an answer for too long, or is owed too much."""
        silent = time.monotonic() - self._heard > PATIENCE_S
        return (bool(self._sent) and silent) or len(self._waiting) > MAX_WAITING

    def drop(self) -> None:
        """Let it go at once, whatever it has not read."""
        self.connection.transport.abort()

    async def feed(self) -> None:
        """Send what there is to send until the connection ends."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._wake.wait()
                self._wake.clear()
                while (text := self._next()) is not None:
                    # A socket that takes nothing holds us up here, not the other clients.
                    await self.connection.send(text)

    def _next(self) -> str | None:
        if self._waiting:
            return self._waiting.popleft()
        if not self.greeted:
            return None
        if self._status is not None:
            text, self._status = self._status, None
            return text
        if self._tail is not None:
            self._lines, lines = self._tail.since(self._lines)
            if lines:
                return json.dumps({"t": "log", "lines": lines})
        if len(self._sent) >= AHEAD:
            return None
        found = self._past.since(self._last)
        if found is None:
            return None
        frame, hits = found
        self._last = frame.number
        if not self._sent:
            self._heard = time.monotonic()
        self._sent.append(frame.number)
        return frame.text(hits)
