"""A canvas in Rerun: in its viewer, at an address, or in a file (.rrd) to open later."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.plotting.palette import colour_of
from lodeline.rotation import Quaternion
from lodeline.viewers import NoViewerError
from lodeline.viewers.drawing import BASE, MAP, Point

if TYPE_CHECKING:  # 0.5 GB on the disk: only who wants it has it
    import rerun as rr

TIMELINE = "stamp"
ROBOT_HALF = (0.06, 0.05, 0.02)  # m: of a box about as large as the robots are
AXES = 0.08  # m


class RerunCanvas:
    """`where`: nothing opens the viewer, `rerun+http://...` is one that runs, else a new file.

    NoViewerError if the SDK is missing, its viewer does not start, or there is such a file already.
    """

    def __init__(self, name: str, where: str) -> None:
        try:
            import rerun
        except ImportError:
            raise NoViewerError(
                "Rerun's SDK is not installed: pip install 'lodeline[viz]' (it takes 0.7 GB)"
            ) from None
        if where and "://" not in where and Path(where).exists():
            raise NoViewerError(f"{where} exists already: give another name")
        from numpy import datetime64

        self._rr, self._datetime64 = rerun, datetime64
        self._frames: set[str] = set()
        self._stream: rr.RecordingStream = rerun.RecordingStream(f"lodeline {name}")
        try:
            if not where:
                self._stream.spawn()
            elif "://" in where:
                self._stream.connect_grpc(where)
            else:
                self._stream.save(where)
        except (RuntimeError, ValueError, OSError) as error:
            raise NoViewerError(f"Rerun: {error}") from None
        self._stream.log(MAP, rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        body = rerun.Boxes3D(half_sizes=[ROBOT_HALF], colors=[_rgb(BASE)])
        self._stream.log(f"{MAP}/{BASE}/body", body, static=True)

    def points(self, stamp: int, name: str, points: Sequence[Point]) -> None:
        """See `Canvas`."""
        dots = self._rr.Points3D([(x, y, 0.0) for x, y in points], colors=[_rgb(name)], radii=0.004)
        self._log(stamp, f"{MAP}/{name}", dots)

    def line(self, stamp: int, name: str, points: Sequence[Point]) -> None:
        """See `Canvas`."""
        strip = [(x, y, 0.0) for x, y in points]
        self._log(stamp, f"{MAP}/{name}", self._rr.LineStrips3D([strip], colors=[_rgb(name)]))

    def frame(self, stamp: int, name: str, at: Point, orientation: Quaternion) -> None:
        """See `Canvas`."""
        turned = self._rr.Quaternion(xyzw=orientation)
        place = self._rr.Transform3D(translation=(*at, 0.0), quaternion=turned)
        if name not in self._frames:
            self._frames.add(name)
            self._stream.log(f"{MAP}/{name}", self._rr.TransformAxes3D(AXES), static=True)
        self._log(stamp, f"{MAP}/{name}", place)

    def scalars(self, stamp: int, key: str, values: Mapping[str, float]) -> None:
        """See `Canvas`."""
        for name, value in values.items():
            self._log(stamp, f"{key}/{name}", self._rr.Scalars(value))

    def close(self) -> None:
        """See `Canvas`."""
        self._stream.flush()
        self._stream.disconnect()

    def _log(self, stamp: int, entity: str, what: rr.AsComponents) -> None:
        self._stream.set_time(TIMELINE, timestamp=self._datetime64(stamp, "ns"))
        self._stream.log(entity, what)


def _rgb(name: str) -> tuple[int, int, int]:
    text = colour_of(name)
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)
