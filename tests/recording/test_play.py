"""Playing back in time: pace, stamps, and never over a running source."""

from __future__ import annotations

from pathlib import Path

import pytest

from lodeline.recording import RecordingError
from lodeline.recording.play import choose, play
from lodeline.recording.read import Packed, Recording
from lodeline.recording.write import RecordingWriter
from lodeline_msgs import Message, ReedBar, WheelTicks, pack, unpack

TYPES: dict[str, type[Message]] = {"wheels": WheelTicks}


class SlowClock:
    """A clock that moves when one sleeps on it, and 1 ms for each sample put."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.put: list[tuple[float, WheelTicks]] = []

    def sleep(self, seconds: float) -> None:
        self.now += seconds + 0.0004  # a sleep always takes a little longer

    def take(self, key: str, data: bytes) -> None:
        self.put.append((self.now - 1000.0, unpack(data, WheelTicks)))
        self.now += 0.001


def wheels(count: int, step: int = 10_000_000) -> list[Packed]:
    made = []
    for i in range(count):
        message = WheelTicks(5_000_000_000 + i * step, i, 0, seq=i)
        made.append(Packed("wheels", pack(message), message.stamp, i, message.stamp + 7))
    return made


@pytest.mark.parametrize("rate", [0.5, 1.0, 4.0])
def test_delays_do_not_add_up(rate: float) -> None:
    clock = SlowClock()
    played = play(
        wheels(500), TYPES, clock.take, rate=rate, now=lambda: clock.now, sleep=clock.sleep
    )
    assert played.samples == 500
    for i, (at, message) in enumerate(clock.put):
        assert message.left == i
        assert 0.0 <= at - 0.010 * i / rate < 0.0005
    assert played.latest < 0.0005


def test_player_that_falls_behind_says_by_how_much_and_skips_nothing() -> None:
    clock = SlowClock()
    played = play(
        wheels(100, step=500_000), TYPES, clock.take, now=lambda: clock.now, sleep=clock.sleep
    )
    assert played.samples == len(clock.put) == 100
    assert played.latest == pytest.approx(99 * 0.0005, abs=1e-6)  # 1 ms a sample, due each 0.5 ms


def test_bytes_go_out_untouched_unless_the_stamps_are_moved() -> None:
    clock = SlowClock()
    data: list[bytes] = []
    play(
        wheels(5), TYPES, lambda _, each: data.append(each), now=lambda: clock.now,
        sleep=clock.sleep,
    )  # fmt: skip
    assert data == [packed.data for packed in wheels(5)]


def test_moved_stamps_begin_at_the_start_and_keep_their_distances() -> None:
    clock = SlowClock()
    start = 1_700_000_000_123_456_789
    play(wheels(5), TYPES, clock.take, start=start, now=lambda: clock.now, sleep=clock.sleep)
    assert [message for _, message in clock.put] == [
        WheelTicks(start + i * 10_000_000, i, 0, seq=i) for i in range(5)
    ]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    file = tmp_path / "run.mcap"
    with file.open("wb") as stream:
        writer = RecordingWriter(stream, {})
        writer.write("wheels", WheelTicks(1, 0, 0))
        writer.write("reeds", ReedBar(1, 0))
        writer.close()
    return file


def test_keys_taken_from_outside_are_played_and_those_a_node_sends_left_out(
    recording: Path,
) -> None:
    with Recording(recording) as file:
        choice = choose(file, {"wheels": "WheelTicks", "cmd_vel": "Twist"}, {"reeds": "bar"})
    assert choice.types == {"wheels": WheelTicks}
    assert choice.left_out == {"reeds": "bar"}


def test_nothing_is_played_over_running_sources(recording: Path) -> None:
    with Recording(recording) as file, pytest.raises(RecordingError) as error:
        choose(file, {}, {"reeds": "bar", "wheels": "encoders"})
    assert "wheels comes from its node encoders already" in str(error.value)
    assert "it has wheels, reeds; the pipeline takes none" in str(error.value)


def test_key_of_another_class_than_the_pipeline_takes_is_refused(recording: Path) -> None:
    with (
        Recording(recording) as file,
        pytest.raises(RecordingError, match="wheels is WheelTicks here, the pipeline takes Imu"),
    ):
        choose(file, {"wheels": "Imu"}, {})
