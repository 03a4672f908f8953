"""Frames for the page: the newest sample of each key, twenty times a second, for a minute back."""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from lodeline.dash.scene import brief
from lodeline.keys import is_truth
from lodeline.run_folder import Manifest
from lodeline_msgs import (
    AttitudeEstimate,
    DecodeError,
    MagnetDetection,
    Message,
    Odometry,
    PoseEstimate,
    unpack,
)

RATE_HZ = 20.0
PAST_S = 60.0
MAX_HITS = 64

FIELDS: dict[type[Message], tuple[str, ...]] = {
    PoseEstimate: ("x", "y", "yaw", "covariance", "nis", "rejected", "ambiguous"),
    Odometry: ("x", "y", "yaw", "v", "w", "resets"),
    AttitudeEstimate: ("orientation", "heading_std", "disturbed"),
}
"""Classes that the page draws, and what it needs of them."""

Hit = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture: its number, its JSON without the last brace, the magnets seen since the last."""

    number: int
    head: str
    hits: tuple[Hit, ...]

    def text(self, hits: Iterable[Hit] | None = None) -> str:
        """Its JSON, with hits of frames that were left out before it."""
        return f'{self.head},"hits":{json.dumps(self.hits if hits is None else [*hits])}}}'


class Newest:
    """The newest sample of each key of one run, and where its magnets were seen.

    `take` may be called from any thread; `frame` belongs to one.
    """

    def __init__(self, manifest: Manifest, bar_x: float) -> None:
        classes = {cls.__name__: cls for cls in FIELDS}
        keys = manifest.keys.items()
        self.keys = {key: classes[known.type] for key, known in keys if known.type in classes}
        self.detections = [
            key for key, known in keys if known.type == MagnetDetection.__name__ and known.node
        ]
        poses = [key for key, cls in self.keys.items() if cls is PoseEstimate]
        odometry = [key for key, cls in self.keys.items() if cls is Odometry and not is_truth(key)]
        self._pose_key = next(iter(poses + odometry), None)
        self._prefix = f"{manifest.name}/"
        self._bar_x = bar_x
        self._data: dict[str, tuple[bytes, float]] = {}
        self._said: dict[str, tuple[bytes, dict[str, Any]]] = {}
        self._hits: deque[Hit] = deque(maxlen=MAX_HITS)

    def take(self, key: str, data: bytes, _encoding: str) -> None:
        """A sample of a key that is drawn; only the last one before a frame is looked at."""
        self._data[key] = (data, time.monotonic())

    def take_detection(self, _key: str, data: bytes, _encoding: str) -> None:
        """Magnets under the bar: put where the newest pose says that the bar is."""
        pose = None if self._pose_key is None else self._data.get(self._pose_key)
        if pose is None or self._pose_key is None:
            return
        try:
            lateral = unpack(data, MagnetDetection).lateral
            if lateral:
                self._place(unpack(pose[0], self.keys[self._pose_key]), lateral)
        except DecodeError:
            return  # the node that should have it counts and tells it

    def _place(self, pose: Any, lateral: tuple[float, ...]) -> None:
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        for left in lateral:
            x = pose.x + c * self._bar_x - s * left
            y = pose.y + s * self._bar_x + c * left
            self._hits.append((round(x, 5), round(y, 5)))

    def frame(self, number: int) -> Frame:
        """The state now."""
        now = time.monotonic()
        keys = {}
        for key, (data, arrived) in list(self._data.items()):
            if said := self._decoded(key, data):
                keys[key.removeprefix(self._prefix)] = said | {"age": round(now - arrived, 3)}
        hits = tuple(self._hits.popleft() for _ in range(len(self._hits)))
        head = {"t": "frame", "n": number, "at": round(time.time(), 3), "keys": keys}
        return Frame(number, json.dumps(head, separators=(",", ":"))[:-1], hits)

    def _decoded(self, key: str, data: bytes) -> dict[str, Any] | None:
        known = self._said.get(key)
        if known is not None and known[0] is data:
            return known[1]
        cls = self.keys[key]
        try:
            message = unpack(data, cls)
        except DecodeError:
            return None if known is None else known[1]
        said = {name: brief(getattr(message, name)) for name in FIELDS[cls]}
        said |= {"stamp": round(message.stamp * 1e-9, 6), "seq": message.seq}
        self._said[key] = (data, said)
        return said


class Past:
    """The frames of the last minute."""

    def __init__(self) -> None:
        self.frames: deque[Frame] = deque(maxlen=int(PAST_S * RATE_HZ))

    def batches(self, size: int) -> list[str]:
        """All frames as JSON messages of at most `size` characters each, oldest first."""
        found: list[str] = []
        batch: list[str] = []
        length = 0
        for frame in self.frames:
            text = frame.text()
            if batch and length + len(text) + 1 > size - 32:
                found.append(_batch(batch))
                batch, length = [], 0
            batch.append(text)
            length += len(text) + 1
        return [*found, _batch(batch)] if batch else found

    def since(self, number: int) -> tuple[Frame, list[Hit]] | None:
        """The newest frame, with all hits after frame `number`; None if there is nothing new."""
        if not self.frames or self.frames[-1].number <= number:
            return None
        hits: list[Hit] = []
        for frame in reversed(self.frames):
            if frame.number <= number or len(hits) >= MAX_HITS:
                break
            hits[:0] = frame.hits
        return self.frames[-1], hits[-MAX_HITS:]


def _batch(texts: list[str]) -> str:
    return f'{{"t":"past","frames":[{",".join(texts)}]}}'
