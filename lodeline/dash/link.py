"""The gateway's line to a running pipeline: found, followed, lost and found again."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from typing import Any

from lodeline.bus import BusError, Publisher
from lodeline.dash.frames import Newest
from lodeline.dash.scene import drive_key, scene, status_of
from lodeline.dash.tail import Tail
from lodeline.pipeline.load import load_unchanged
from lodeline.run_folder import Manifest, Running, running
from lodeline.sessions import Client
from lodeline.watch import CALIBRATING
from lodeline_msgs import DecodeError, NodeStatus, Twist, encoding_of, pack, unpack

LOOK_S = 0.5
ASK_S = 1.0
MAX_CALIBRATING = 32_768
REST_S = 60.0
"""When nobody has looked for so long, the pipeline no more sends samples here."""


class Run:
    """One run of a pipeline on the bus, from its discovery to its end.

    `scene` is what the page is told once, `newest` what it is drawn from, `tail` the log.
    """

    def __init__(self, target: Running) -> None:
        self.manifest: Manifest = target.manifest
        runs = target.manifest
        pipeline = load_unchanged(runs.file, runs.digest, runs.overrides)
        self.scene: dict[str, Any] = scene(self.manifest, pipeline)
        self.newest = Newest(self.manifest, self.scene["floor"]["bar_x"])
        self.tail = Tail()
        self._statuses: dict[str, tuple[NodeStatus, float]] = {}
        self._processes: list[dict[str, Any]] = []
        self._client = Client(target.folder)
        self._wheel: Publisher | None = None
        self._commands = 0
        for key in self.newest.keys:
            self._client.subscribe(key, 1, self.newest.take)
        for key in self.newest.detections:
            self._client.subscribe(key, 64, self.newest.take_detection)
        self._client.subscribe_kept(f"{self.manifest.name}/status/*", self._on_status)
        self._client.subscribe(f"{self.manifest.name}/@log/*", 64, self.tail.take)
        self._client.subscribe(f"{self.manifest.name}/{CALIBRATING}", 1, self._on_calibrating)
        self._calibrating: str | None = None
        self._kept_asked = False
        self.unheard: str | None = None
        if wheel := drive_key(self.manifest):
            self.unheard = self.manifest.unheard(wheel)
            self._wheel = self._client.publisher(wheel, encoding_of(Twist))

    def _on_status(self, _key: str, data: bytes, _encoding: str) -> None:
        try:
            status = unpack(data, NodeStatus)
        except DecodeError:
            return  # it will be silent on the page, which is what a reader can do about it
        known = self._statuses.get(status.node)
        if known is None or status.stamp >= known[0].stamp:
            self._statuses[status.node] = (status, time.monotonic())

    def _on_calibrating(self, _key: str, data: bytes, _encoding: str) -> None:
        try:
            said = json.loads(data)
        except (ValueError, RecursionError):
            return
        if isinstance(said, dict) and len(data) <= MAX_CALIBRATING:
            self._calibrating = json.dumps(said | {"t": "calibrate"})

    def calibrating(self) -> str | None:
        """What a calibration has to show since the last call, for the page."""
        said, self._calibrating = self._calibrating, None
        return said

    def ask_supervisors(self) -> None:
        """Let them tell of their processes and, once, what was logged; waits a second at most."""
        answers = self._client.ask(f"{self.manifest.name}/@ps/*", ASK_S)
        self._processes = [item for _, data in answers for item in _processes(data)]
        if not self._kept_asked:
            self._kept_asked = True
            self.tail.begin(self._client.ask(f"{self.manifest.name}/@log/*", ASK_S))

    def status(self) -> dict[str, Any]:
        """How nodes and processes fare now."""
        now = time.monotonic()
        prefix = f"{self.manifest.name}/"
        said = sorted(self._statuses.items())
        return {
            "t": "status",
            "at": round(time.time(), 3),
            "nodes": {name: status_of(status, prefix, now - at) for name, (status, at) in said},
            "processes": self._processes,
        }

    def command(self, v: float, w: float) -> None:
        """Publish a wanted speed [m/s] and yaw rate [rad/s], if the pipeline takes any."""
        if self._wheel is not None:
            self._wheel.put(pack(Twist(time.time_ns(), v, w, seq=self._commands)))
            self._commands += 1

    def restart(self, node: str) -> str:
        """Ask the node's supervisor to start it again; what came of it, in words. Waits."""
        if why := self.manifest.refusal("restart", node):
            return why
        answers = self._client.ask(f"{self.manifest.name}/@restart/*/{node}", ASK_S)
        if not answers:
            return f"no supervisor takes a restart of {node}"
        words = {data.decode(errors="replace")[:200] for _, data in answers}
        return f"{node}: {', '.join(sorted(words))}"

    def close(self) -> None:
        self._client.close()


def _processes(data: bytes) -> list[dict[str, Any]]:
    """What a supervisor told of its processes; nothing if it is of another version, or none."""
    try:
        told = json.loads(data)["processes"]
        return [item for item in told if isinstance(item["nodes"], list) and "state" in item]
    except (ValueError, KeyError, TypeError, RecursionError):
        return []


class Link:
    """Follows the pipeline of a name in a thread of its own; `run` is None while it is away.

    `known` says that it was looked for since somebody wants to know. `changed()` is called from
    that thread whenever `run` became another one, or is known to be none; `failed` is what ended
    the thread.
    """

    def __init__(self, name: str, changed: Callable[[], None]) -> None:
        self.name = name
        self.run: Run | None = None
        self.known = False
        self.failed: BaseException | None = None
        self._changed = changed
        self._over = False
        self._wake = threading.Event()
        self._looked = time.monotonic()
        self._thread = threading.Thread(target=self._follow, name="link", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def close(self) -> None:
        """Leave the bus."""
        self._over = True
        self._wake.set()
        self._thread.join(2.0 + ASK_S)

    def look(self) -> None:
        """Somebody looks at this moment."""
        rested = time.monotonic() - self._looked >= REST_S
        self._looked = time.monotonic()
        if rested:
            self.known = False
            self._wake.set()

    def _follow(self) -> None:
        try:
            self._keep_up()
        except BaseException as error:
            self.failed = error
            raise

    def _keep_up(self) -> None:
        asked = 0.0
        while not self._over:
            self._wake.clear()
            wanted = time.monotonic() - self._looked < REST_S
            found = running(self.name) if wanted else []
            self._meet(found[0] if found else None)
            if wanted and not self.known:
                self.known = True
                if self.run is None:
                    self._changed()
            if self.run is not None and time.monotonic() - asked >= ASK_S:
                asked = time.monotonic()
                self.run.ask_supervisors()
            self._wake.wait(LOOK_S)
        self._meet(None)

    def _meet(self, target: Running | None) -> None:
        run = self.run
        if run is not None and (target is None or target.manifest != run.manifest):
            self.run = None
            self._changed()
            run.close()
        if target is not None and self.run is None:
            try:
                self.run = Run(target)
            except BusError:
                return  # its hub is not there yet, or no more
            self._changed()
