"""Claims about playing from the keyboard: pause, start in the middle, again and again."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from lodeline.recording.play import play
from lodeline.recording.read import Packed
from lodeline.recording.write import RecordingWriter
from lodeline.sessions import Client
from lodeline_msgs import Twist, pack, unpack
from tests.support.live import ROOT, Up, environment, eventually

pytestmark = pytest.mark.paired  # waits for a recording to be over

SECOND = 1_000_000_000


def twists(count: int) -> list[Packed]:
    """Ten a second."""
    made = []
    for i in range(count):
        message = Twist(5 * SECOND + i * SECOND // 10, 0.01 * i, 0.0, seq=i)
        made.append(Packed("cmd_vel", pack(message), message.stamp, i, message.stamp))
    return made


def test_a_pause_moves_all_that_follows_and_nothing_is_sent_meanwhile() -> None:
    now = 100.0
    sent: list[float] = []
    looked: list[float] = []

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds

    def look(_log_time: int) -> float:
        nonlocal now
        looked.append(now)
        if len(sent) == 5 and now - 100.0 <= 7.0:
            now += 7.0
            return 7.0
        return 0.0

    play(
        twists(10),
        {"cmd_vel": Twist},
        lambda _key, _data: sent.append(now - 100.0),
        now=lambda: now,
        sleep=sleep,
        look=look,
    )
    expected = [0.1 * i + (7.0 if i >= 5 else 0.0) for i in range(10)]
    assert sent == pytest.approx(expected, abs=1e-9)
    gaps = [after - before for before, after in pairwise(looked)]
    assert sorted(gaps)[-2] <= 0.1 + 1e-9


@pytest.fixture(scope="module")
def up() -> Iterator[Up]:
    with Up(ROOT / "pipeline.yaml") as running:
        yield running


class Commands:
    """The commands that the pipeline is sent."""

    def __init__(self, up: Up) -> None:
        self._lock = threading.Lock()
        self._got: list[Twist] = []
        self._client = Client(up.folder)
        self._client.subscribe("rover/cmd_vel", 256, self._take)

    def _take(self, _key: str, data: bytes, _encoding: str) -> None:
        with self._lock:
            self._got.append(unpack(data, Twist))

    @property
    def numbers(self) -> list[int]:
        with self._lock:
            return [message.seq for message in self._got]

    def close(self) -> None:
        self._client.close()


@pytest.fixture
def commands(up: Up) -> Iterator[Commands]:
    heard = Commands(up)
    yield heard
    heard.close()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    file = tmp_path / "drive.mcap"
    with file.open("wb") as stream:
        writer = RecordingWriter(stream, {})
        for packed in twists(30):
            writer.write("cmd_vel", unpack(packed.data, Twist))
        writer.close()
    return file


def test_space_pauses_and_goes_on(up: Up, commands: Commands, recording: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", "bag", "play", str(recording)],
        env=environment(up.run, TERM="xterm"),
        stdin=theirs,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
    )
    os.close(theirs)
    shown = bytearray()

    def read() -> None:
        try:
            while data := os.read(ours, 4096):
                shown.extend(data)
        except OSError:  # the other end is closed
            pass

    threading.Thread(target=read, daemon=True).start()
    assert eventually(lambda: len(commands.numbers) >= 5, 20.0)
    os.write(ours, b" ")
    assert eventually(lambda: b"paused" in shown, 5.0)
    held = commands.numbers
    assert not eventually(lambda: len(commands.numbers) > len(held) + 1, 1.0)
    os.write(ours, b" ")
    assert process.wait(20.0) == 0
    assert eventually(lambda: commands.numbers == list(range(30)), 3.0)
    assert b"/ 2.9 s" in shown


def test_play_begins_where_it_is_told_and_goes_round(
    up: Up, commands: Commands, recording: Path
) -> None:
    process = subprocess.Popen(
        [
            *(sys.executable, "-P", "-m", "lodeline", "bag", "play", str(recording)),
            *("--start", "2.4", "--loop", "--keys", "cmd_vel"),
        ],
        env=environment(up.run),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    assert eventually(lambda: len(commands.numbers) >= 14, 20.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(10.0) == 130
    assert commands.numbers[:14] == [24, 25, 26, 27, 28, 29] * 2 + [24, 25]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--start", "60"), "it lasts 2.9 s"),
        (("--rate", "2"), "needs a pipeline with `clock: recording`"),
        (("--keys", "wheels"), "no key 'wheels'"),
    ],
)
def test_what_cannot_be_played_is_refused(
    up: Up, recording: Path, words: tuple[str, ...], reason: str
) -> None:
    result = up.call("bag", "play", str(recording), *words)
    assert result.returncode == (4 if words[0] == "--keys" else 1)
    assert reason in result.stderr
