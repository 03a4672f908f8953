"""Claims about Rerun and Foxglove: their own readers find what zenoh carried."""

from __future__ import annotations

import json
import re
import signal
import struct
import subprocess
import sys
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets import Subprotocol
from websockets.sync.client import ClientConnection, connect

from lodeline.rotation import to_euler
from tests.dash.support import Ear
from tests.support.live import ROOT, Up, environment, eventually

KEYS = ("pose", "odom", "attitude", "truth")


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


@pytest.fixture(scope="module")
def ear(up: Up) -> Iterator[Ear]:
    made = Ear(up, *KEYS)
    yield made
    made.close()


def by_stamp(ear: Ear, key: str) -> dict[int, Any]:
    """Samples of a key; of one stamp the first, which is what a viewer is shown of it."""
    found: dict[int, Any] = {}
    for _, sample in sorted(ear.all(key).items()):
        found.setdefault(sample.stamp, sample)
    return found


def dash(up: Up, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", "dash", *arguments],
        cwd=ROOT,
        env=environment(up.run),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def rerun_columns(file: Path) -> dict[str, dict[str, list[Any]]]:
    """Columns of each entity, as Rerun's own reader has them: stamps in ns, values as lists."""
    from rerun.chunk import RrdReader

    found: dict[str, dict[str, list[Any]]] = {}
    for chunk in RrdReader(str(file)).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path).startswith("/__"):
            continue  # what Rerun says of the file
        for name in batch.schema.names:
            if name != "stamp" and ":" not in name:
                continue  # when it was logged, and Rerun's own numbering
            column = batch.column(name)
            values = (column.cast("int64") if name == "stamp" else column).to_pylist()
            found.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(values)
    return found


def test_rerun_shows_what_zenoh_carried(up: Up, ear: Ear, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="no rerun-sdk here: pip install 'lodeline[viz]'")
    file = tmp_path / "rover.rrd"
    process = dash(up, "--rerun", str(file))
    assert eventually(lambda: file.is_file() and file.stat().st_size > 0, 30.0)
    listened = len(ear.all("pose"))
    assert eventually(lambda: len(ear.all("pose")) > listened + 300)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20.0)
    assert process.returncode == 130, err
    found = rerun_columns(file)
    for key, field in (("pose", "x"), ("pose", "nis"), ("odom", "v"), ("truth", "yaw")):
        columns = found[f"/{key}/{field}"]
        samples = by_stamp(ear, key)
        values = columns["Scalars:scalars"]
        assert len(values) > 40
        compared = 0
        for stamp, (value,) in zip(columns["stamp"], values, strict=True):
            if stamp in samples and (key != "pose" or _alone(ear, stamp)):
                assert value == getattr(samples[stamp], field), (key, field)
                compared += 1
        assert compared > 40
    attitude, turned = by_stamp(ear, "attitude"), found["/map/attitude"]
    pairs = zip(turned["stamp"], turned["Transform3D:quaternion"], strict=False)
    known = [(attitude[stamp], q) for stamp, q in pairs if stamp in attitude and q]
    assert len(known) > 40
    for sample, (q,) in known:
        assert q == pytest.approx(sample.orientation, abs=1e-6)
    assert len(found["/map/trail/pose"]["LineStrips3D:strips"]) > 5
    assert len(found["/map/magnets"]["Points3D:positions"][-1]) > 1000
    ellipse = found["/map/ellipse/pose"]["LineStrips3D:strips"][-1][0]
    assert len(ellipse) == 49
    assert ellipse[0] == pytest.approx(ellipse[-1])
    assert "/map/base_link" in found
    again = dash(up, "--rerun", str(file))
    _, err = again.communicate(timeout=20.0)
    assert (again.returncode, err) == (1, f"{file} exists already: give another name\n")


def _alone(ear: Ear, stamp: int) -> bool:
    """Whether one pose has this stamp: a magnet that comes late makes a second one."""
    return [each.stamp for each in ear.all("pose").values()].count(stamp) == 1


class Foxglove:
    """A client of Foxglove's WebSocket protocol, version 1."""

    def __init__(self, url: str) -> None:
        known = [Subprotocol("foxglove.sdk.v1")]
        self._connecting = connect(url, subprotocols=known, max_size=None, close_timeout=1.0)
        self.socket: ClientConnection = self._connecting.__enter__()
        self.channels: dict[int, dict[str, Any]] = {}
        self.got: dict[str, list[tuple[int, bytes]]] = {}

    def listen(
        self, enough: dict[str, int], scene: Collection[bytes], seconds: float = 30.0
    ) -> None:
        """Subscribe to all that is offered until so many messages of some topics came, and all
        these entities of the scene.
        """

        def step() -> bool:
            said = self.socket.recv(timeout=seconds)
            if isinstance(said, bytes):
                self._data(said)
            else:
                words: dict[str, Any] = json.loads(said)
                if words["op"] == "advertise":
                    self._subscribe(words["channels"])
            return not lacking()

        def lacking() -> list[object]:
            few = [t for t, count in enough.items() if len(self.got.get(t, ())) < count]
            return [*few, *(name for name in scene if name not in self.all("/scene"))]

        assert eventually(step, seconds, 0.0), f"lacking {lacking()}"

    def _subscribe(self, offered: list[dict[str, Any]]) -> None:
        self.channels |= {each["id"]: each for each in offered}
        ids = [{"id": each["id"], "channelId": each["id"]} for each in offered]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": ids}))

    def _data(self, said: bytes) -> None:
        if said[0] == 1:
            number, stamp = struct.unpack("<IQ", said[1:13])
            self.got.setdefault(self.channels[number]["topic"], []).append((stamp, said[13:]))

    def all(self, topic: str) -> bytes:
        return b"".join(data for _, data in self.got.get(topic, ()))

    def close(self) -> None:
        self._connecting.__exit__(None, None, None)


def test_foxglove_shows_what_zenoh_carried(up: Up, ear: Ear) -> None:
    pytest.importorskip("foxglove", reason="no foxglove-sdk here: pip install 'lodeline[viz]'")
    process = dash(up, "--foxglove", "--port", "0")
    assert process.stdout is not None
    url = process.stdout.readline().strip()
    assert re.fullmatch(r"ws://127\.0\.0\.1:\d+", url), url
    client = Foxglove(url)
    drawn = (b"trail/pose", b"ellipse/pose", b"magnets", b"robot", b"hits")
    client.listen({"/pose": 60, "/odom": 60, "/attitude": 60, "/tf": 20, "/scene": 10}, drawn)
    taken = dash(up, "--foxglove", "--port", url.rpartition(":")[2])
    _, err = taken.communicate(timeout=30.0)
    assert (taken.returncode, "cannot serve on port" in err) == (1, True), err
    process.send_signal(signal.SIGTERM)
    assert process.wait(20.0) == 0
    client.close()
    schemas = {each["topic"]: each["schemaName"] for each in client.channels.values()}
    assert schemas["/scene"] == "foxglove.SceneUpdate"
    assert schemas["/tf"] == "foxglove.FrameTransform"
    for key, fields in (("pose", ("x", "y", "yaw", "nis")), ("odom", ("v", "w", "x"))):
        samples = by_stamp(ear, key)
        compared = 0
        for stamp, data in client.got[f"/{key}"]:
            if stamp in samples and (key != "pose" or _alone(ear, stamp)):
                said = json.loads(data)
                assert [said[each] for each in fields] == [
                    getattr(samples[stamp], each) for each in fields
                ]
                compared += 1
        assert compared > 40
    attitude = by_stamp(ear, "attitude")
    both = [(attitude[t], data) for t, data in client.got["/attitude"] if t in attitude]
    assert len(both) > 40
    for sample, data in both:
        said = json.loads(data)
        angles = (said["roll"], said["pitch"], said["yaw"])
        assert angles == pytest.approx(to_euler(sample.orientation), abs=1e-12)
    frames = client.all("/tf")
    assert b"base_link" in frames
    assert b"attitude" in frames


@pytest.mark.parametrize(("option", "module"), [("--rerun", "rerun"), ("--foxglove", "foxglove")])
def test_without_its_sdk_a_viewer_is_refused_with_advice(
    up: Up, tmp_path: Path, option: str, module: str
) -> None:
    (tmp_path / f"{module}.py").write_text("raise ImportError('not installed')\n")
    result = subprocess.run(
        [sys.executable, "-m", "lodeline", "dash", option],
        cwd=ROOT,
        env=environment(up.run, PYTHONPATH=str(tmp_path)),
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    assert result.returncode == 1
    assert "pip install 'lodeline[viz]'" in result.stderr


def test_the_drawing_is_thinned_and_the_ellipse_holds_95_of_100() -> None:
    """On a canvas of lists: no more than 50 of a key in a second, 5.991 on the rim."""
    from lodeline.ekf import LocalizerParams
    from lodeline.viewers.drawing import Drawing
    from lodeline_msgs import PoseEstimate

    class Paper:
        def __init__(self) -> None:
            self.lines: dict[str, list[Any]] = {}
            self.numbers: list[tuple[int, str]] = []

        def points(self, stamp: int, name: str, points: Any) -> None: ...

        def frame(self, stamp: int, name: str, at: Any, orientation: Any) -> None: ...

        def close(self) -> None: ...

        def line(self, stamp: int, name: str, points: Any) -> None:
            self.lines.setdefault(name, []).append(points)

        def scalars(self, stamp: int, key: str, values: Any) -> None:
            self.numbers.append((stamp, key))

    paper = Paper()
    drawing = Drawing(paper, LocalizerParams(), {"pose": "PoseEstimate"})
    p = (4e-4, 1e-4, 0.0, 1e-4, 1e-4, 0.0, 0.0, 0.0, 1e-3)
    for i in range(200):
        stamp = 10**15 + i * 5_000_000
        drawing.take("pose", PoseEstimate(stamp, 0.01 * i, 0.0, 0.0, p, 0.0, 0, False))
    assert 40 <= len(paper.numbers) <= 70
    assert 3 <= len(paper.lines["trail/pose"]) <= 6
    for x, y in (point for point in paper.lines["ellipse/pose"][0]):
        det = p[0] * p[4] - p[1] * p[1]
        distance = (p[4] * x * x - 2 * p[1] * x * y + p[0] * y * y) / det
        assert distance == pytest.approx(5.991, abs=1e-3)
    back = PoseEstimate(10**12, 0.0, 0.0, 0.0, p, 0.0, 0, False)
    drawing.take("pose", back)  # a recording that begins again
    assert paper.numbers[-1] == (10**12, "pose")
