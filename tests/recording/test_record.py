"""Claims about live recording: nothing lost, and a file that survives kills and full disks."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from lodeline.recording import RecordingError, localizer
from lodeline.recording.live import record_live
from lodeline.recording.read import Recording
from lodeline.recording.record import Recorder, default_name
from lodeline.recording.recover import recover
from lodeline.recording.room import Room
from lodeline.recording.sink import BALLAST
from lodeline.recording.summary import summarize
from lodeline.sessions import Client
from lodeline.watch import Watch
from lodeline_msgs import Imu, Twist, class_of, encoding_of, pack, unpack
from tests.support.live import ROOT, Up, environment, eventually, lodeline

WHEN = time.struct_time((2026, 11, 23, 6, 48, 32, 0, 327, 0))
IMU = encoding_of(Imu)


def imu(seq: int, stamp: int | None = None) -> bytes:
    # Every number differs, so that compression does not make the disk look larger than it is.
    values = tuple(((seq * 7919 + i) % 65521) / 977 for i in range(6))
    when = 1_000_000_000 + seq * 1_000_000 if stamp is None else stamp
    return pack(Imu(when, values[:3], values[3:], seq=seq))  # type: ignore[arg-type]


def recorder(path: Path, *, replace: bool = False) -> Recorder:
    return Recorder(path, "rover", {"imu/data": "Imu"}, {"pipeline": "rover"}, replace=replace)


def numbers(file: Path, key: str = "imu/data") -> list[int]:
    with Recording(file) as recording:
        return [packed.seq for packed in recording.packed([key])]


# -- the file ----------------------------------------------------------------------------------


def test_samples_are_kept_byte_for_byte_and_losses_are_noted(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    made = recorder(file)
    sent = [imu(seq) for seq in (5, 6, 9, 10, 20)]
    for data in sent:
        made.take("rover/imu/data", data, IMU)
    made.take("rover/unknown", sent[0], IMU)
    made.take("rover/imu/data", b"\xc1", IMU)
    made.take("rover/imu/data", pack(Twist(1, 0.0, 0.0)), encoding_of(Twist))
    # A sender that was restarted counts anew: no loss.
    made.take("rover/imu/data", imu(0, stamp=9_000_000_000), IMU)
    made.close("interrupted")
    with Recording(file) as recording:
        assert [packed.data for packed in recording.packed()][:5] == sent
        assert recording.metadata["lost"] == "11 of imu/data"
        assert recording.metadata["end"] == "interrupted"
        assert list(recording.channels) == ["imu/data"]
        assert summarize(recording).keys["imu/data"].lost == 11
    assert made.samples == 6
    assert made.refused == {"imu/data": "Twist where Imu is expected"}


def test_a_recording_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    file.write_text("dear")
    with pytest.raises(RecordingError, match="exists already"):
        recorder(file)
    assert file.read_text() == "dear"
    recorder(file, replace=True).close("")
    assert numbers(file) == []


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="there is no such folder: make it first"):
        recorder(tmp_path / "nowhere" / "run.mcap")


def test_the_ballast_is_seen_by_nobody(tmp_path: Path) -> None:
    made = recorder(tmp_path / "run.mcap")
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.mcap"]
    made.close("")


def test_default_names_have_pipeline_and_time() -> None:
    assert default_name("rover", WHEN) == "rover-20261123-064832.mcap"


@given(st.text() | st.text(alphabet="./\\\0~ a\u2024\uff0f"))
def test_no_pipeline_name_leads_out_of_the_folder(name: str) -> None:
    try:
        made = default_name(name, WHEN)
    except RecordingError as error:
        assert "not allowed" in str(error)
        return
    assert Path(made).name == made
    assert not made.startswith(".")
    assert made.isascii() and made.isprintable() and " " not in made


# -- disk full ---------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Makes a file system of so many bytes."""
    if os.geteuid() != 0:
        pytest.skip("only root may mount a small tmpfs")
    mounted: list[Path] = []

    def make(size: int) -> Path:
        folder = tmp_path / f"disk{len(mounted)}"
        folder.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"no tmpfs can be mounted here: {done.stderr.strip()}")
        mounted.append(folder)
        return folder

    yield make
    for folder in mounted:
        subprocess.run(["umount", str(folder)], check=True)


def test_a_full_disk_costs_no_sample_that_was_taken(small_disk: Callable[[int], Path]) -> None:
    for turn in range(8):
        file = small_disk(400_000 + 118_457 * turn) / "run.mcap"
        made = recorder(file)
        for seq in range(200_000):
            made.take("rover/imu/data", imu(seq), IMU)
            if seq % 500 == 499:
                made.sink.hold()  # what `tend` does, but for the look that would stop it sooner
            if made.stopped.is_set():
                break
        assert made.sink.full
        taken = made.samples
        made.close("disk full")
        assert made.sink.pending == 0
        assert made.sink.error is None
        with file.open("rb") as stream:  # the stock reader
            found = [message.sequence for _, _, message in make_reader(stream).iter_messages()]
        assert found == list(range(taken)), turn
        assert taken > 0


def test_a_disk_without_room_to_begin_with_is_refused(small_disk: Callable[[int], Path]) -> None:
    folder = small_disk(BALLAST // 2)
    with pytest.raises(RecordingError, match="No space left on device"):
        recorder(folder / "run.mcap")
    assert list(folder.iterdir()) == []


def take_room(folder: Path, size: int) -> None:
    with (folder / "of somebody else").open("wb") as other:
        os.posix_fallocate(other.fileno(), 0, size)


def test_a_disk_that_gets_full_is_told_of_once_and_its_reserve_is_left_to_others(
    small_disk: Callable[[int], Path],
) -> None:
    folder = small_disk(40_000_000)
    made = recorder(folder / "run.mcap")
    said = []
    for seq in range(4):
        made.take("rover/imu/data", imu(seq), IMU)
        made.tend()
        said.append(made.room.news)
        if seq == 2:
            assert not made.stopped.is_set()
            take_room(folder, 36_500_000)
    assert made.stopped.is_set()
    assert said == ["DISK_LOW 39 MB left on the disk of " + str(folder), "", "", ""]
    made.close("disk full")
    assert not made.sink.full
    assert numbers(folder / "run.mcap") == [0, 1, 2, 3]


def test_on_a_disk_with_no_more_than_its_reserve_no_recording_begins(
    small_disk: Callable[[int], Path],
) -> None:
    folder = small_disk(40_000_000)
    take_room(folder, 36_500_000)
    with pytest.raises(RecordingError, match=r"DISK_LOW 3 MB .* its last 4 MB are left to others"):
        recorder(folder / "run.mcap")
    assert [entry.name for entry in folder.iterdir()] == ["of somebody else"]
    assert "200 MB" in Room(small_disk(4_000_000_000)).spared, "of a disk that is not small"


def test_how_long_the_disk_lasts_is_until_its_reserve_is_reached(
    small_disk: Callable[[int], Path],
) -> None:
    folder = small_disk(40_000_000)
    take_room(folder, 30_000_000)
    room = Room(folder)
    room._begun -= 60.0
    room.look(written=3_000_000)  # 10 MB are left, 4 of them to others: 6 at 3 MB a minute
    assert room.news.endswith("enough for 2.0 min")


# -- beside a running pipeline -----------------------------------------------------------------


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml", "--set", "ekf.gate=9.3") as running:
        yield running


def start(up: Up, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", "bag", "record", *words],
        env=environment(up.run),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def grows(file: Path, beyond: int) -> bool:
    return eventually(lambda: file.exists() and file.stat().st_size > beyond, 30.0)


def test_every_key_is_recorded_without_a_gap_and_ctrl_c_is_the_regular_end(
    up: Up, tmp_path: Path
) -> None:
    process = start(up, "-o", str(tmp_path / "run.mcap"))
    assert grows(tmp_path / "run.mcap", 200_000)
    process.send_signal(signal.SIGINT)
    said, complaints = process.communicate(timeout=10.0)
    assert (process.returncode, complaints) == (0, "")
    assert said.rstrip().endswith("interrupted, nothing lost")
    with Recording(tmp_path / "run.mcap") as recording:
        assert recording.metadata["lost"] == "nothing"
        assert recording.metadata["digest"] == up.running.manifest.digest
        keys = {key for key, known in up.running.keys().items() if known.node is not None}
        status = {f"status/{node}" for node in up.running.manifest.nodes}
        assert set(recording.channels) == keys | status
        summary = summarize(recording)
    assert all(key.lost == 0 for key in summary.keys.values())
    assert summary.keys["imu/data"].samples > 100


def test_what_is_recorded_can_be_computed_again(up: Up, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    done = up.call("bag", "record", "-o", str(file), "--seconds", "1")
    assert done.returncode == 0, done.stderr
    with Recording(file) as recording:
        noted = localizer.read(recording.metadata)
    assert noted is not None
    assert noted.gate == 9.3  # as it ran, not as the file has it
    result = lodeline("replay", str(file), "--pipeline", str(ROOT / "pipeline.yaml"), run=tmp_path)
    assert result.returncode == 0, result.stderr
    row = re.search(r"^pose +(\d+) .* ekf$", result.stdout, re.MULTILINE)
    assert row is not None and int(row[1]) > 50


def test_only_the_chosen_keys_are_recorded(up: Up, tmp_path: Path) -> None:
    result = subprocess.run(
        [
            *(sys.executable, "-P", "-m", "lodeline"),
            *("bag", "record", "data_raw", "pose", "--seconds", "1"),
        ],
        env=environment(up.run),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=30.0,
    )
    assert result.returncode == 0, result.stderr
    (file,) = tmp_path.iterdir()
    assert file.name.startswith("rover-20")
    with Recording(file) as recording:
        assert set(recording.channels) == {"imu/data_raw", "pose"}
    wrong = up.call("bag", "record", "poze", "-o", str(tmp_path / "x.mcap"))
    assert wrong.returncode == 4
    assert "did you mean 'pose'?" in wrong.stderr
    assert not (tmp_path / "x.mcap").exists()


class Listener:
    """Numbers of the samples of a key, and when each came [s]."""

    def __init__(self, up: Up, key: str) -> None:
        self._came: dict[int, float] = {}
        self._lock = threading.Lock()
        self._client = Client(up.folder)
        self._client.subscribe(key, 4096, self._take)

    def _take(self, _key: str, data: bytes, encoding: str) -> None:
        with self._lock:
            self._came[unpack(data, class_of(encoding)).seq] = time.monotonic()

    def when(self, seq: int) -> float:
        with self._lock:
            return self._came[seq]

    def newest(self) -> int:
        with self._lock:
            return max(self._came, default=-1)

    def between(self, first: int, last: int) -> set[int]:
        with self._lock:
            return {seq for seq in self._came if first < seq < last}

    def close(self) -> None:
        self._client.close()


@pytest.fixture
def listener(up: Up) -> Iterator[Listener]:
    heard = Listener(up, "rover/imu/data_raw")
    yield heard
    heard.close()


@pytest.mark.live
def test_a_kill_costs_at_most_the_last_six_tenths_of_a_second(
    up: Up, listener: Listener, tmp_path: Path
) -> None:
    # The file grows twice a second: the kill comes so many samples of 5 ms after that.
    for turn, after in enumerate((0, 45, 90)):
        file, saved = tmp_path / f"run{turn}.mcap", tmp_path / f"saved{turn}.mcap"
        process = start(up, "imu/data_raw", "-o", str(file))
        assert grows(file, 8_000)
        last = listener.newest() + after
        assert eventually(lambda: listener.newest() >= last)  # noqa: B023
        process.kill()
        killed = time.monotonic()
        process.communicate()
        result = lodeline("bag", "recover", str(file), "-o", str(saved), run=tmp_path)
        assert result.returncode == 3
        found = numbers(saved, "imu/data_raw")
        assert found == list(range(found[0], found[-1] + 1))
        lost = killed - listener.when(found[-1])
        print(f"killed {after * 5} ms after a flush: {lost:.3f} s lost")
        assert lost <= 0.6


@pytest.mark.live
def test_a_power_cut_costs_at_most_the_last_1_2_seconds(
    up: Up, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    confirmed: list[tuple[float, int]] = []  # when [s] the disk had how many bytes for certain
    real = os.fdatasync

    def fdatasync(descriptor: int) -> None:
        size = os.fstat(descriptor).st_size
        real(descriptor)
        confirmed.append((time.monotonic(), size))

    monkeypatch.setattr(os, "fdatasync", fdatasync)
    monkeypatch.setenv("LODELINE_RUN", str(up.run))  # where the pipeline is looked for
    file, cut, saved = tmp_path / "run.mcap", tmp_path / "cut.mcap", tmp_path / "saved.mcap"
    heard = Listener(up, "rover/truth")
    with Watch(up.running) as watch:
        # A key so slow that it fills no chunk in a second: full ones go to the disk by themselves.
        made = Recorder(file, "rover", {"truth": "Odometry"}, {"pipeline": "rover"})
        begun = time.monotonic()
        record_live(watch, made, 3.6, threading.Event(), lambda _: None)
    heard.close()
    data = file.read_bytes()
    assert confirmed[0][0] - begun <= 1.2
    # The worst moment for a cut is just before the disk confirms the next bytes.
    for turn, ((_, size), (worst, _)) in enumerate(pairwise(confirmed)):
        cut.write_bytes(data[:size] + bytes(4096 * (turn % 2)))  # room that was given, not filled
        found = recover(cut, saved, replace=True)
        assert not found.complete
        kept = numbers(saved, "truth")
        assert kept == list(range(kept[0], kept[-1] + 1))
        lost = worst - heard.when(kept[-1] + 1)
        assert lost <= 1.2
        print(f"{lost:.2f} s lost")
    assert len(confirmed) >= 3


def test_a_recorder_that_was_frozen_asks_for_what_it_missed_and_says_so(
    up: Up, listener: Listener, tmp_path: Path
) -> None:
    file = tmp_path / "run.mcap"
    process = start(up, "imu/data_raw", "-o", str(file))
    assert grows(file, 10_000)
    process.send_signal(signal.SIGSTOP)
    time.sleep(4.0)  # longer than the bus bears with anybody
    process.send_signal(signal.SIGCONT)
    size = file.stat().st_size
    assert grows(file, size + 10_000)
    process.send_signal(signal.SIGINT)
    said, complaints = process.communicate(timeout=10.0)
    assert process.returncode == 0
    found = numbers(file, "imu/data_raw")
    assert found == list(range(found[0], found[-1] + 1))
    assert listener.between(found[0], found[-1]) <= set(found)
    with Recording(file) as recording:
        assert recording.metadata["lost"] == "nothing"
        count = recording.metadata["filled"].removesuffix(" of imu/data_raw")
    assert int(count) > 100
    assert f"FILLED {count} samples, " in complaints
    assert said.rstrip().endswith(f"nothing lost ({count} on the way, had from their senders)")


def test_a_live_recorder_on_a_full_disk_says_so_and_leaves_a_readable_file(
    up: Up, small_disk: Callable[[int], Path]
) -> None:
    file = small_disk(500_000) / "run.mcap"
    before = up.ps()
    process = start(up, "-o", str(file))
    _, complaints = process.communicate(timeout=30.0)
    assert process.returncode == 1
    low, full = complaints.splitlines()
    assert low.startswith("DISK_LOW 0 MB left on the disk of ")
    assert full.startswith("DISK_FULL recording stopped at ")
    with Recording(file) as recording:
        assert recording.metadata["end"] == "disk full"
        assert all(key.lost == 0 for key in summarize(recording).keys.values())
    after = up.ps()
    assert {name: each["pid"] for name, each in after.items()} == {
        name: each["pid"] for name, each in before.items()
    }


@pytest.fixture
def freezable_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system on which every write waits while it is frozen."""
    image, folder = tmp_path / "image", tmp_path / "disk"
    folder.mkdir()
    with image.open("wb") as file:
        file.truncate(24_000_000)
    for command in (
        ["mkfs.ext4", "-q", "-F", str(image)],
        ["mount", "-o", "loop", str(image), str(folder)],
    ):
        try:
            subprocess.run(command, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no file system can be made here to freeze: {error}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.live
def test_a_disk_that_stands_still_costs_what_did_not_fit_the_ring_and_the_file_says_so(
    up: Up, listener: Listener, freezable_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1.4 s without a write: 280 samples of one key, 70 of the other, rings of 120."""
    monkeypatch.setenv("LODELINE_RUN", str(up.run))
    monkeypatch.setattr("lodeline.recording.live.QUEUE", 120)
    file = freezable_disk / "run.mcap"
    before = up.ps()
    with Watch(up.running) as watch:
        made = Recorder(
            file, "rover", {"imu/data_raw": "Imu", "truth": "Odometry"}, {"pipeline": "rover"}
        )
        freeze = "sleep 0.5; fsfreeze -f $0; sleep 1.4; fsfreeze -u $0"
        with subprocess.Popen(["sh", "-c", freeze, str(freezable_disk)]) as frozen:
            record_live(watch, made, 2.8, threading.Event(), lambda _: None)
        assert frozen.returncode == 0
    found = set(numbers(file, "imu/data_raw"))
    sent = listener.between(min(found) - 1, max(found) + 1)
    assert sent == set(range(min(found), max(found) + 1)), "nobody else noticed"
    missed = len(sent - found)
    assert missed > 60
    kept = numbers(file, "truth")
    assert kept == list(range(kept[0], kept[-1] + 1))
    with Recording(file) as recording:
        assert recording.metadata["lost"] == f"{missed} of imu/data_raw"
    assert {name: each["pid"] for name, each in up.ps().items()} == {
        name: each["pid"] for name, each in before.items()
    }


@pytest.mark.live
def test_a_thousand_samples_a_second_are_recorded_without_a_gap(tmp_path: Path) -> None:
    node = tmp_path / "fast.py"
    node.write_text(FAST)
    pipeline = tmp_path / "fast.yaml"
    pipeline.write_text("name: fast\nnodes:\n  fast: {run: fast.py, outputs: {imu: imu}}\n")
    file = tmp_path / "run.mcap"
    with Up(pipeline) as up:
        done = up.call("bag", "record", "imu", "-o", str(file), "--seconds", "2.5")
    assert done.returncode == 0, done.stderr
    found = numbers(file, "imu")
    assert found == list(range(found[0], found[-1] + 1))
    assert len(found) > 1250  # a busy machine lets the source itself miss ticks


FAST = '''
"""A thousand readings a second."""
from dataclasses import dataclass
from typing import Annotated

from lodeline.node import Driver, Output
from lodeline_msgs import Imu


@dataclass(frozen=True, slots=True)
class FastParams:
    rate: Annotated[float, "Hz"] = 1000.0


class Fast(Driver[FastParams]):
    imu = Output(Imu)

    def tick(self, stamp: int) -> None:
        self.imu.send(Imu(stamp, (0.1, 0.2, 0.3), (0.0, 0.1, 9.81)))


if __name__ == "__main__":
    from lodeline.process import run

    run(Fast)
'''
