"""What tests of the page share: the gateway as a user starts it, the bus beside it."""

from __future__ import annotations

import asyncio
import json
import select
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect

from lodeline.sessions import Client
from lodeline_msgs import DecodeError, class_of, unpack
from tests.support.live import ROOT, Up, environment

START_S = 30.0


class Dash:
    """`lodeline dash` beside a running pipeline."""

    def __init__(self, up: Up, *arguments: str) -> None:
        command = [sys.executable, "-P", "-m", "lodeline", "dash", *arguments]
        self.process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment(up.run),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self.process.stdout is not None
        # a line that does not come fails this test, and does not hold up all others
        assert select.select([self.process.stdout], [], [], START_S)[0], "it prints no address"
        self.url = self.process.stdout.readline().strip()
        assert self.url.startswith("http://127.0.0.1:"), self.url
        self.port = urlsplit(self.url).port or 0
        self.token = self.url.partition("#token=")[2]

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(10.0)


class Ear:
    """All samples of some keys of a running pipeline, by key and number."""

    def __init__(self, up: Up, *keys: str) -> None:
        self._client = Client(up.folder)
        self._came = threading.Condition()
        self._heard: dict[str, dict[int, Any]] = {key: {} for key in keys}
        for key in keys:
            self._client.subscribe(f"rover/{key}", 4096, self._take)

    def _take(self, key: str, data: bytes, encoding: str) -> None:
        try:
            message = unpack(data, class_of(encoding))
        except DecodeError:
            return
        with self._came:
            self._heard[key.removeprefix("rover/")][message.seq] = message
            self._came.notify_all()

    def all(self, key: str) -> dict[int, Any]:
        """Samples by number."""
        with self._came:
            return dict(self._heard[key])

    def newest(self, key: str) -> Any:
        """The last sample that came, None if none did."""
        with self._came:
            return next(reversed(self._heard[key].values()), None)

    def hears(self, key: str, what: Callable[[Any], bool], seconds: float = 15.0) -> bool:
        """Whether a newest sample comes, or is there, of which something holds."""

        def found() -> bool:
            newest = next(reversed(self._heard[key].values()), None)
            return newest is not None and what(newest)

        with self._came:
            return self._came.wait_for(found, seconds)

    def hears_many(self, key: str, count: int, seconds: float = 15.0) -> bool:
        """Whether there come to be so many samples."""
        with self._came:
            return self._came.wait_for(lambda: len(self._heard[key]) >= count, seconds)

    def close(self) -> None:
        self._client.close()


class Reader:
    """A page without a browser: reads frames, confirms them or not."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    async def say(self, **message: Any) -> None:
        await self.socket.send(json.dumps(message))

    async def hear(self, kind: str, seconds: float = 20.0) -> dict[str, Any]:
        """The next message of a kind; frames are not confirmed."""
        async with asyncio.timeout(seconds):
            while True:
                said: dict[str, Any] = json.loads(await self.socket.recv())
                if said["t"] == kind:
                    return said

    async def hear_of(self, key: str, seconds: float = 20.0) -> Any:
        """The first sample of a key; the frames before it are confirmed."""
        async with asyncio.timeout(seconds):
            while True:
                (frame,) = await self.frames(1)
                if key in frame["keys"]:
                    return frame["keys"][key]

    async def frames(self, count: int) -> list[dict[str, Any]]:
        """So many frames, each confirmed at once."""
        found = []
        for _ in range(count):
            frame = await self.hear("frame")
            found.append(frame)
            await self.say(ack=frame["n"])
        return found


def connecting(port: int, **more: Any) -> connect:
    """A WebSocket to the gateway as its own page opens it."""
    options = {"origin": f"http://127.0.0.1:{port}", "compression": None} | more
    return connect(f"ws://127.0.0.1:{port}/ws", **options)


def with_reader(port: int, talk: Callable[[Reader], Any], token: str = "") -> Any:
    """Run `await talk(reader)` over a connection that has said hello."""

    async def run() -> Any:
        async with connecting(port) as socket:
            reader = Reader(socket)
            await reader.say(do="hello", token=token)
            return await talk(reader)

    return asyncio.run(run())
