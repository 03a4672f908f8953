"""Replay over a recording: the same bytes each time, and only what the nodes compute."""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from lodeline.node import Driver, Input, Node, Output
from lodeline.pipeline.model import NodeSpec, Pipeline
from lodeline.recording import RecordingError
from lodeline.recording.magnet_lab import messages, read_rows
from lodeline.recording.offline import Outcome, Replay
from lodeline.recording.read import Recording
from lodeline.recording.table import Tables, read_tables
from lodeline.recording.write import RecordingWriter
from lodeline_msgs import Message, PoseEstimate, ReedBar, WheelTicks, columns, pack, stamp_text
from tests.recording.conftest import drive

Sent = list[tuple[str, Message]]
SpecMaker = Callable[..., NodeSpec]
PipelineMaker = Callable[..., Pipeline]


@pytest.fixture
def lab_recording(lab_text: Path, tmp_path: Path) -> Path:
    return record(tmp_path / "lab.mcap", list(messages(read_rows(lab_text))))


def record(path: Path, samples: Sent) -> Path:
    with path.open("wb") as stream:
        writer = RecordingWriter(stream, {})
        for key, message in samples:
            writer.write(key, message)
        writer.close()
    return path


def replay(pipeline: Pipeline, file: Path, tmp_path: Path) -> tuple[Outcome, Sent]:
    sent: Sent = []
    with Recording(file) as recording:
        outcome = Replay(pipeline).run(
            recording, tmp_path, [lambda key, message, _: sent.append((key, message))]
        )
    return outcome, sent


def test_same_recording_gives_the_same_bytes(
    lab_pipeline: Pipeline, lab_recording: Path, tmp_path: Path
) -> None:
    first, sent = replay(lab_pipeline, lab_recording, tmp_path)
    second, again = replay(lab_pipeline, lab_recording, tmp_path)
    assert first.digest == second.digest
    assert sent == again
    assert {key: traffic.samples for key, traffic in first.traffic.items()} == {
        "wheels": 400, "reeds": 400, "odom": 400, "magnets": 400, "pose": 400,
    }  # fmt: skip
    assert first.traffic["pose"].rate == pytest.approx(20.0)
    assert first.traffic["pose"].source == "ekf"
    assert first.traffic["wheels"].source is None


def test_digest_is_of_keys_and_bytes_in_the_order_of_sending(
    lab_pipeline: Pipeline, lab_recording: Path, tmp_path: Path
) -> None:
    outcome, sent = replay(lab_pipeline, lab_recording, tmp_path)
    digest = hashlib.sha256()
    for key, message in sent:
        if key in ("odom", "magnets", "pose"):
            digest.update(key.encode() + pack(message))
    assert outcome.digest == digest.hexdigest()


def test_one_count_more_changes_the_digest(
    lab_pipeline: Pipeline, lab_text: Path, lab_recording: Path, tmp_path: Path
) -> None:
    rows = read_rows(lab_text)
    rows[200] = rows[200]._replace(left=rows[200].left + 1)
    other = record(tmp_path / "other.mcap", list(messages(rows)))
    first, _ = replay(lab_pipeline, lab_recording, tmp_path)
    second, _ = replay(lab_pipeline, other, tmp_path)
    assert first.digest != second.digest


def test_magnets_hold_the_pose_where_odometry_drifts(
    lab_pipeline: Pipeline, lab_recording: Path, tmp_path: Path
) -> None:
    _, sent = replay(lab_pipeline, lab_recording, tmp_path)
    truth = [row[:2] for row in drive(400)]
    squares = {"odom": 0.0, "pose": 0.0}
    for key in squares:
        where = [(m.x, m.y) for k, m in sent if k == key]  # type: ignore[attr-defined]
        assert len(where) == 400
        squares[key] = sum(
            (x - tx) ** 2 + (y - ty) ** 2 for (x, y), (tx, ty) in zip(where, truth, strict=True)
        )
    rms = {key: math.sqrt(square / 400) for key, square in squares.items()}
    assert rms["odom"] > 0.010
    assert rms["pose"] < 0.004


def test_recorded_keys_that_a_node_computes_are_computed_anew(
    lab_pipeline: Pipeline, lab_text: Path, lab_recording: Path, tmp_path: Path
) -> None:
    lie = PoseEstimate(101_000_000_000, 9.0, 9.0, 9.0, (0.0,) * 9, 0.0, 0, False)
    samples = [*messages(read_rows(lab_text)), ("pose", lie), ("unknown/to/all", lie)]
    full = record(tmp_path / "full.mcap", samples)
    outcome, sent = replay(lab_pipeline, full, tmp_path)
    assert outcome.digest == replay(lab_pipeline, lab_recording, tmp_path)[0].digest
    assert lie not in [message for _, message in sent]


def test_replay_of_a_replay_gives_the_same_bytes(
    lab_pipeline: Pipeline, lab_recording: Path, tmp_path: Path
) -> None:
    with Recording(lab_recording) as recording, (tmp_path / "all.mcap").open("wb") as stream:
        writer = RecordingWriter(stream, {})
        outcome = Replay(lab_pipeline).run(recording, tmp_path, [writer.write])
        writer.close()
    again, _ = replay(lab_pipeline, tmp_path / "all.mcap", tmp_path)
    assert again.digest == outcome.digest


def test_missing_keys_are_named_with_those_that_are_there(
    lab_pipeline: Pipeline, tmp_path: Path
) -> None:
    file = record(tmp_path / "half.mcap", [("wheels", WheelTicks(1, 0, 0))])
    with pytest.raises(
        RecordingError, match=r"lacks reeds \(ReedBar\); it has wheels \(WheelTicks\)"
    ):
        replay(lab_pipeline, file, tmp_path)


def test_key_of_another_class_is_refused(lab_pipeline: Pipeline, tmp_path: Path) -> None:
    file = record(tmp_path / "odd.mcap", [("wheels", ReedBar(1, 0)), ("reeds", ReedBar(1, 0))])
    with pytest.raises(RecordingError, match="wheels is ReedBar, the pipeline takes WheelTicks"):
        replay(lab_pipeline, file, tmp_path)


@dataclass(frozen=True, slots=True)
class Params:
    """Of the nodes below."""

    rate: float = 100.0


class Wheels(Driver[Params]):
    """A driver that must not be started: a replay has no device."""

    wheels = Output(WheelTicks)

    def setup(self) -> None:
        raise OSError("no such bus")


class Halves(Node[Params]):
    """Halves counts, and cannot halve an odd one."""

    wheels = Input(WheelTicks)
    half = Output(WheelTicks)

    @wheels.handler
    def on_wheels(self, ticks: WheelTicks) -> None:
        if ticks.left % 2:
            raise ValueError(f"{ticks.left} is odd")
        self.context.report("running", f"fours: {ticks.left % 4 == 0}")
        self.half.send(WheelTicks(ticks.stamp, ticks.left // 2, 0))


def test_drivers_stay_out_and_their_keys_come_from_the_recording(
    make_spec: SpecMaker, make_pipeline: PipelineMaker, tmp_path: Path
) -> None:
    pipeline = make_pipeline(
        make_spec("encoders", Wheels, {}, {"wheels": "wheels"}),
        make_spec("halves", Halves, {"wheels": "wheels"}, {"half": "half"}),
    )
    file = record(tmp_path / "run.mcap", [("wheels", WheelTicks(i, 2 * i, 0)) for i in range(5)])
    _, sent = replay(pipeline, file, tmp_path)
    assert [m.left for key, m in sent if key == "half"] == [0, 1, 2, 3, 4]  # type: ignore[attr-defined]


def test_exception_of_a_handler_is_counted_and_told_and_the_replay_goes_on(
    make_spec: SpecMaker, make_pipeline: PipelineMaker, tmp_path: Path
) -> None:
    pipeline = make_pipeline(make_spec("halves", Halves, {"wheels": "wheels"}, {"half": "half"}))
    file = record(tmp_path / "run.mcap", [("wheels", WheelTicks(i, i, 0)) for i in range(20)])
    outcome, sent = replay(pipeline, file, tmp_path)
    assert outcome.failed == {"halves": 10}
    assert outcome.faults[0].startswith("halves: ValueError: 1 is odd at WheelTicks(stamp=1,")
    assert len(outcome.faults) == 5
    assert sum(key == "half" for key, _ in sent) == 10


def test_what_a_node_says_again_and_again_is_counted_and_not_printed(
    make_spec: SpecMaker,
    make_pipeline: PipelineMaker,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pipeline = make_pipeline(make_spec("halves", Halves, {"wheels": "wheels"}, {"half": "half"}))
    file = record(tmp_path / "run.mcap", [("wheels", WheelTicks(i, 2 * i, 0)) for i in range(10)])
    outcome, _ = replay(pipeline, file, tmp_path)
    assert outcome.said == {"halves: fours: True": 5, "halves: fours: False": 5}
    assert capsys.readouterr().err == ""


def test_error_of_a_listener_ends_the_replay_instead_of_being_blamed_on_a_node(
    lab_pipeline: Pipeline, lab_recording: Path, tmp_path: Path
) -> None:
    def full(key: str, message: Message, log_time: int) -> None:
        if key == "pose":
            raise OSError(28, "No space left on device")

    with Recording(lab_recording) as recording, pytest.raises(OSError, match="No space left"):
        Replay(lab_pipeline).run(recording, tmp_path, [full])


def test_tables_hold_every_number_to_the_last_bit(
    lab_pipeline: Pipeline, lab_recording: Path, tmp_path: Path
) -> None:
    plan = Replay(lab_pipeline)
    sent: Sent = []
    with (
        Recording(lab_recording) as recording,
        Tables(tmp_path / "out", (plan.inputs | plan.outputs).items()) as tables,
    ):
        plan.run(
            recording,
            tmp_path,
            [
                lambda key, message, _: tables.write(key, message),
                lambda key, message, _: sent.append((key, message)),
            ],
        )
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"wheels.csv", "reeds.csv", "odom.csv", "magnets.csv", "pose.csv"}
    with (tmp_path / "out" / "pose.csv").open(newline="") as stream:
        header, *rows = list(csv.reader(stream))
    poses = [message for key, message in sent if key == "pose"]
    assert header == columns(PoseEstimate)
    assert len(rows) == len(poses)
    assert [message for key, message in read_tables(tmp_path / "out") if key == "pose"] == poses
    for cells, message in zip(rows, poses, strict=True):
        assert isinstance(message, PoseEstimate)
        cell = dict(zip(header, cells, strict=True))
        assert cell["stamp"] == stamp_text(message.stamp)
        assert (float(cell["x"]), float(cell["yaw"])) == (message.x, message.yaw)
        assert float(cell["covariance_xyaw"]) == message.covariance[2]
    with (tmp_path / "out" / "wheels.csv").open() as text:
        assert text.readline() == "stamp,left,right,seq\n"
        assert text.readline() == "100.000000000,0,0,0\n"
