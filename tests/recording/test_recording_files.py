"""Recordings as files: what others read in them, what is left of damaged ones."""

from __future__ import annotations

import io
import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import msgpack
import pytest
from mcap.reader import make_reader

from lodeline.recording import RecordingError
from lodeline.recording.read import Recording
from lodeline.recording.recover import recover
from lodeline.recording.write import FLUSH_S, RecordingWriter, whole_file
from lodeline_msgs import Imu, MagnetDetection, Message, PoseEstimate, WheelTicks

SHORT = 700
MATRIX = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def some_messages(count: int) -> list[tuple[str, Message]]:
    """Messages of four classes, each on a key of its own, 10 ms apart."""
    made: list[tuple[str, Message]] = []
    for i in range(count):
        stamp = 1_700_000_000_000_000_000 + 10_000_000 * i
        seq = i // 4
        kinds: list[tuple[str, Message]] = [
            ("wheels", WheelTicks(stamp, i, -i, seq=seq)),
            ("imu/data", Imu(stamp, (0.1 * i, 0.0, -1.5), (0.0, 0.0, 9.81), seq=seq)),
            ("magnets", MagnetDetection(stamp, (0.005,) * (i % 3), seq=seq)),
            ("pose", PoseEstimate(stamp, 1 / 3, 2.0, 3.0, MATRIX, 0.5, i, False, seq=seq)),
        ]
        made.append(kinds[i % 4])
    return made


def recorded(path: Path, messages: list[tuple[str, Message]], **metadata: str) -> Path:
    with path.open("wb") as stream:
        writer = RecordingWriter(stream, metadata)
        for key, message in messages:
            writer.write(key, message)
        writer.close()
    return path


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Five chunks or so, for what is done to a file again and again."""
    return recorded(tmp_path / "short.mcap", some_messages(SHORT), pipeline="robot", clock="host")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return recorded(tmp_path / "run.mcap", some_messages(2000), pipeline="robot", clock="host")


def test_every_message_comes_back_as_it_was(file: Path) -> None:
    with Recording(file) as recording:
        assert [(key, message) for key, message, _ in recording.samples()] == some_messages(2000)
        assert recording.metadata == {"pipeline": "robot", "clock": "host"}
        assert {key: (info.type, info.count) for key, info in recording.channels.items()} == {
            "wheels": (WheelTicks, 500),
            "imu/data": (Imu, 500),
            "magnets": (MagnetDetection, 500),
            "pose": (PoseEstimate, 500),
        }


def test_official_reader_finds_schema_encoding_times_and_numbers(file: Path) -> None:
    expected = some_messages(2000)
    with file.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(found) == len(expected)
    for (schema, channel, record), (key, message) in zip(found, expected, strict=True):
        assert schema is not None
        assert (schema.name, schema.encoding) == (type(message).__name__, "jsonschema")
        assert (channel.topic, channel.message_encoding) == (key, "msgpack")
        assert record.log_time == record.publish_time == message.stamp
        assert record.sequence == message.seq


def test_each_payload_fits_the_json_schema_of_its_channel(file: Path) -> None:
    with file.open("rb") as stream:
        found = list(make_reader(stream).iter_messages())
    for schema, _, record in found[:40]:
        assert schema is not None
        jsonschema.validate(msgpack.unpackb(record.data), json.loads(schema.data))
    schema, _, record = found[0]
    assert schema is not None
    values = msgpack.unpackb(record.data)
    del values["left"]
    with pytest.raises(jsonschema.ValidationError, match="left"):
        jsonschema.validate(values, json.loads(schema.data))


def test_order_is_by_time_of_receipt_then_as_written(tmp_path: Path) -> None:
    with (tmp_path / "late.mcap").open("wb") as stream:
        writer = RecordingWriter(stream, {})
        for stamp, log_time in ((50, 300), (10, 100), (20, 300), (30, 200), (40, None)):
            writer.write("wheels", WheelTicks(stamp, 0, 0), log_time)
        writer.close()
    with Recording(tmp_path / "late.mcap") as recording:
        order = [(message.stamp, log_time) for _, message, log_time in recording.samples()]
    assert order == [(40, 40), (10, 100), (30, 200), (50, 300), (20, 300)]


def test_same_messages_make_the_same_bytes(tmp_path: Path) -> None:
    messages = some_messages(500)
    first = recorded(tmp_path / "a.mcap", messages).read_bytes()
    assert recorded(tmp_path / "b.mcap", messages).read_bytes() == first


def test_key_that_changes_its_class_is_refused() -> None:
    writer = RecordingWriter(io.BytesIO(), {})
    writer.write("wheels", WheelTicks(1, 0, 0))
    with pytest.raises(RecordingError, match="wheels is WheelTicks, now MagnetDetection"):
        writer.write("wheels", MagnetDetection(2, ()))


def test_time_before_1970_is_refused() -> None:
    writer = RecordingWriter(io.BytesIO(), {})
    with pytest.raises(RecordingError, match="before 1970"):
        writer.write("wheels", WheelTicks(-1, 0, 0))


def test_new_file_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"
    with pytest.raises(ZeroDivisionError), whole_file(target) as stream:
        stream.write(b"half")
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
    with whole_file(target) as stream:
        stream.write(b"all")
        assert not target.exists()
    with pytest.raises(RecordingError, match=r"exists already.*--force"), whole_file(target):
        pass
    with whole_file(target, replace=True) as stream:
        stream.write(b"new")
    assert target.read_bytes() == b"new"


def test_missing_file_and_wrong_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.mcap: there is no such file"):
        Recording(tmp_path / "none.mcap")
    for content in (b"", b"1 2 255 0.05 0 0\n", b"\x89MCAP1\r\n" * 4):
        (tmp_path / "text.mcap").write_bytes(content)
        with pytest.raises(RecordingError, match=r"no MCAP recording .*bag import"):
            Recording(tmp_path / "text.mcap")
    with pytest.raises(RecordingError, match="directory"):
        Recording(tmp_path)


def test_truncated_file_is_refused_with_the_way_out_and_its_whole_part_recovered(
    short: Path, tmp_path: Path
) -> None:
    data, expected = short.read_bytes(), some_messages(SHORT)
    random_numbers = random.Random(1)
    kept = 0
    cut, saved = tmp_path / "cut.mcap", tmp_path / "saved.mcap"
    for size in sorted(random_numbers.sample(range(9, len(data)), 300)):
        cut.write_bytes(data[:size])
        with pytest.raises(RecordingError, match=r"cut off.*lodeline bag recover"):
            Recording(cut)
        try:
            found = recover(cut, saved, replace=True)
        except RecordingError as error:
            assert "not one whole message" in str(error)
            assert kept == 0
            continue
        assert found.end
        with Recording(saved) as recording:
            samples = [(key, message) for key, message, _ in recording.samples()]
            assert recording.metadata == {"pipeline": "robot", "clock": "host"}
        assert samples == expected[: len(samples)]
        assert len(samples) >= kept
        kept = len(samples)
    assert kept > 0.75 * SHORT


def test_flipped_bytes_lead_to_a_clear_error_and_cost_one_chunk(
    short: Path, tmp_path: Path
) -> None:
    data, expected = short.read_bytes(), some_messages(SHORT)
    random_numbers = random.Random(2)
    bad, saved = tmp_path / "bad.mcap", tmp_path / "saved.mcap"
    refused, losses = 0, []
    for i in range(300):
        broken = bytearray(data)
        # every third flip in the summary at the end, which the reader goes by
        first = len(data) - 2000 if i % 3 == 0 else 8
        place = random_numbers.randrange(first, len(data) - 8)
        broken[place] ^= 1 << random_numbers.randrange(8)
        bad.write_bytes(broken)
        try:
            with Recording(bad) as recording:
                read = [(key, message) for key, message, _ in recording.samples()]
        except RecordingError as error:
            assert str(bad) in str(error)
            refused += 1
        else:  # a flip where nothing depends on it, as in the index of a chunk
            assert read == expected
        try:
            losses.append(len(expected) - recover(bad, saved, replace=True).messages)
        except RecordingError:
            losses.append(len(expected))
            continue
        with Recording(saved) as recording:
            rest = iter(expected)
            for key, message, _ in recording.samples():  # in their order, and nothing made up
                assert (key, message) in rest
    assert refused > 150
    assert sorted(losses)[len(losses) // 2] <= 130  # messages of one chunk of 8 KiB


RECORDER = """
import sys
from pathlib import Path
from lodeline.recording.write import FLUSH_S, RecordingWriter
from lodeline_msgs import WheelTicks
import time
with Path(sys.argv[1]).open("wb") as stream:
    writer = RecordingWriter(stream, {"pipeline": "robot"}, flush_every=FLUSH_S)
    seq = 0
    while True:
        writer.write("wheels", WheelTicks(time.time_ns(), seq, seq, seq=seq))
        print(seq, flush=True)
        seq += 1
        time.sleep(0.002)
"""


def test_killed_recorder_loses_less_than_its_flush_time(tmp_path: Path) -> None:
    file, saved = tmp_path / "live.mcap", tmp_path / "saved.mcap"
    recorder = subprocess.Popen(
        [sys.executable, "-P", "-c", RECORDER, str(file)], stdout=subprocess.PIPE, text=True
    )
    assert recorder.stdout is not None
    for line in recorder.stdout:
        if int(line) >= 450:
            break
    os.kill(recorder.pid, signal.SIGKILL)
    written = [450, *(int(line) for line in recorder.stdout.read().split())][-1] + 1
    recorder.stdout.close()
    recorder.wait(5)
    found = recover(file, saved)
    with Recording(saved) as recording:
        stamps: list[Any] = [message.stamp for _, message, _ in recording.samples()]
        seqs = [message.seq for _, message, _ in recording.samples()]
    assert seqs == list(range(found.messages))
    assert 0 < found.messages <= written
    # 2 ms apart or more: the samples lost are those of at most the flush time, and one to spare
    assert (written - found.messages) * 0.002 <= FLUSH_S + 0.1
    assert (stamps[-1] - stamps[0]) * 1e-9 > 0.3


def test_recovering_a_whole_file_loses_nothing(file: Path, tmp_path: Path) -> None:
    found = recover(file, tmp_path / "copy.mcap")
    assert found.complete
    assert found.messages == 2000
    with Recording(file) as one, Recording(tmp_path / "copy.mcap") as other:
        assert list(one.samples()) == list(other.samples())


def test_malformed_payload_is_named_by_key_and_time(tmp_path: Path) -> None:
    with (tmp_path / "odd.mcap").open("wb") as stream:
        writer = RecordingWriter(stream, {})
        writer.write_packed("wheels", WheelTicks, msgpack.packb({"stamp": 5}), 5, 0)
        writer.close()
    with (
        Recording(tmp_path / "odd.mcap") as recording,
        pytest.raises(RecordingError, match=r"wheels at 5 ns: WheelTicks: field 'left' is missing"),
    ):
        list(recording.samples())
