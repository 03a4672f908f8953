"""A canvas in Foxglove: a WebSocket server on this machine that its app connects to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from lodeline.plotting.palette import colour_of
from lodeline.rotation import Quaternion
from lodeline.viewers import NoViewerError
from lodeline.viewers.drawing import BASE, MAP, Point

if TYPE_CHECKING:
    from foxglove import messages

ROBOT = (0.12, 0.10, 0.04)  # m: of a box about as large as the robots are
DOT = 0.008  # m
LINE_PX = 2.0
DEFAULT_PORT = 8765
"""Where Foxglove's app looks unless told otherwise."""


class FoxgloveCanvas:
    """Serves on loopback: the scene on `/scene`, frames on `/tf`, numbers on `/KEY`.

    NoViewerError if the SDK is missing or the port is taken. `url` is what to open in the app.
    """

    def __init__(self, name: str, port: int) -> None:
        try:
            import foxglove
            from foxglove import channels, messages
        except ImportError:
            raise NoViewerError(
                "Foxglove's SDK is not installed: pip install 'lodeline[viz]'"
            ) from None
        foxglove.set_log_level("WARN")
        self._api, self._messages = foxglove, messages
        self._context = foxglove.Context()
        try:
            self._server = foxglove.start_server(
                name=f"lodeline {name}", host="127.0.0.1", port=port, context=self._context
            )
        except (RuntimeError, OSError) as error:
            raise NoViewerError(f"cannot serve on port {port}: {error}") from None
        self.url = f"ws://127.0.0.1:{self._server.port}"
        self._scene = channels.SceneUpdateChannel("/scene", context=self._context)
        self._frames = channels.FrameTransformChannel("/tf", context=self._context)
        self._numbers: dict[str, Any] = {}

    def points(self, stamp: int, name: str, points: Sequence[Point]) -> None:
        """See `Canvas`."""
        m, colour = self._messages, self._colour(name)
        size = m.Vector3(x=DOT, y=DOT, z=DOT)
        dots = [
            m.SpherePrimitive(
                pose=m.Pose(position=m.Vector3(x=x, y=y, z=0.0), orientation=m.Quaternion(w=1.0)),
                size=size,
                color=colour,
            )
            for x, y in points
        ]
        self._show(stamp, m.SceneEntity(frame_id=MAP, id=name, spheres=dots))

    def line(self, stamp: int, name: str, points: Sequence[Point]) -> None:
        """See `Canvas`."""
        m = self._messages
        strip = m.LinePrimitive(
            type=m.LinePrimitiveLineType.LineStrip,
            thickness=LINE_PX,
            scale_invariant=True,
            points=[m.Point3(x=x, y=y, z=0.0) for x, y in points],
            color=self._colour(name),
        )
        self._show(stamp, m.SceneEntity(frame_id=MAP, id=name, lines=[strip]))

    def frame(self, stamp: int, name: str, at: Point, orientation: Quaternion) -> None:
        """See `Canvas`."""
        m = self._messages
        x, y, z, w = orientation
        transform = m.FrameTransform(
            timestamp=self._time(stamp),
            parent_frame_id=MAP,
            child_frame_id=name,
            translation=m.Vector3(x=at[0], y=at[1], z=0.0),
            rotation=m.Quaternion(x=x, y=y, z=z, w=w),
        )
        self._frames.log(transform, log_time=stamp)
        if name == BASE:
            box = m.CubePrimitive(
                pose=m.Pose(position=m.Vector3(), orientation=m.Quaternion(w=1.0)),
                size=m.Vector3(x=ROBOT[0], y=ROBOT[1], z=ROBOT[2]),
                color=self._colour(name),
            )
            self._show(
                stamp, m.SceneEntity(frame_id=BASE, id="robot", frame_locked=True, cubes=[box])
            )

    def scalars(self, stamp: int, key: str, values: Mapping[str, float]) -> None:
        """See `Canvas`."""
        if key not in self._numbers:
            schema = {
                "type": "object",
                "title": key,
                "properties": {name: {"type": "number"} for name in values},
            }
            self._numbers[key] = self._api.Channel(
                f"/{key}", schema=schema, message_encoding="json", context=self._context
            )
        self._numbers[key].log(dict(values), log_time=stamp)

    def close(self) -> None:
        """See `Canvas`."""
        self._server.stop()

    def _show(self, stamp: int, entity: messages.SceneEntity) -> None:
        self._scene.log(self._messages.SceneUpdate(entities=[entity]), log_time=stamp)

    def _time(self, stamp: int) -> messages.Timestamp:
        return self._messages.Timestamp(stamp // 1_000_000_000, stamp % 1_000_000_000)

    def _colour(self, name: str) -> messages.Color:
        text = colour_of(name)
        r, g, b = (int(text[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
        return self._messages.Color(r=r, g=g, b=b, a=1.0)
