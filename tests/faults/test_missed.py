"""Claims about a killed node: it gets what it missed and goes on as if nothing had been."""

from __future__ import annotations

import contextlib
import threading
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lodeline.attitude import METHODS
from lodeline.clock import RecordingClock
from lodeline.inlet import Inlet
from lodeline.keepsake import Keepsake
from lodeline.loading import load_node
from lodeline.missed import Missed
from lodeline.node import Context
from lodeline.recent import NEWEST, Recent, recent_key
from lodeline.recording.read import Recording
from lodeline_msgs import AttitudeEstimate, Imu, MagneticField, Message, pack
from tests.support.live import ROOT

CLASSES = {"imu/data_raw": Imu, "imu/mag_raw": MagneticField}
KILLED, BACK = 300, 480  # of some 600 samples a second: two thirds of a second
KIND = load_node(ROOT / "nodes" / "attitude.py")


@pytest.fixture(scope="module")
def samples() -> list[tuple[str, Message]]:
    with Recording(ROOT / "tests" / "data" / "recordings" / "rover.mcap") as recording:
        found = [(key, message) for key, message, _ in recording.samples(CLASSES)]
    return found[:900]


class Life:
    """One life of the attitude node, fed through inlets as its process does it."""

    def __init__(self, folder: Path, method: str) -> None:
        params = KIND.params_type()(method=method)
        made: Any = KIND(params, Context(name="attitude"))
        self.node = made
        self.said: dict[int, AttitudeEstimate] = {}
        self.muted = False
        self.node.senders["attitude"].sinks.append(self.note)
        clock = RecordingClock()
        node = self.node
        handlers = {"imu/data_raw": node.on_data, "imu/mag_raw": node.on_mag}
        self.inlets: dict[str, Inlet[Any]] = {
            key: Inlet(key, kind, 0.25, clock, self.node.context.reject, handlers[key])
            for key, kind in CLASSES.items()
        }
        self.keepsake = Keepsake(self.node, folder)

    def note(self, message: AttitudeEstimate) -> None:
        if not self.muted:
            self.said[message.stamp] = message

    def mute(self, muted: bool) -> None:
        self.muted = muted

    def take(self, key: str, message: Message) -> None:
        self.inlets[key].take(pack(message), "sensors")

    def store(self) -> None:
        marks = {key: inlet.newest for key, inlet in self.inlets.items()}
        self.keepsake.store(self.keepsake.look(marks))


def uninterrupted(samples: list[tuple[str, Message]], folder: Path, method: str) -> Life:
    life = Life(folder, method)
    for key, message in samples:
        life.take(key, message)
    return life


def ignore(_muted: bool) -> None:
    """Nothing is sent here."""


def keep(recent: Recent, message: Message) -> None:
    recent.keep(message, pack(message))


def answers(senders: Mapping[str, Recent], key: str) -> list[tuple[str, bytes]]:
    return [(key, recent.answer()) for name, recent in senders.items() if recent_key(name) == key]


@pytest.mark.parametrize("method", METHODS)
def test_a_killed_attitude_says_afterwards_what_it_would_have_said(
    samples: list[tuple[str, Message]], tmp_path: Path, method: str
) -> None:
    expected = uninterrupted(samples, tmp_path, method).said
    senders = {key: Recent("sensors") for key in CLASSES}
    first = Life(tmp_path, method)
    for place, (key, message) in enumerate(samples[:KILLED]):
        keep(senders[key], message)
        first.take(key, message)
        if place == KILLED - 60:
            first.store()  # what came after it is not in the state on file
    for key, message in samples[KILLED:BACK]:
        keep(senders[key], message)
    second = Life(tmp_path, method)
    marks = second.keepsake.restore()
    assert marks is not None
    missed = Missed()
    for key, inlet in second.inlets.items():
        missed.hold(inlet, marks[key])
    assert not missed.due()
    for key, message in samples[BACK : BACK + 20]:  # these come live before the answer
        keep(senders[key], message)
        second.take(key, message)
    assert missed.due()
    assert not second.said
    count = missed.catch_up(lambda key, _: answers(senders, key), threading.RLock(), second.mute)
    assert count >= BACK - KILLED + 59
    for key, message in samples[BACK + 20 :]:
        second.take(key, message)
    assert not second.node.context.rejected
    assert all(inlet.lost == 0 for inlet in second.inlets.values())
    live = {m.stamp for key, m in samples[BACK + 20 :] if key == "imu/data_raw"}
    assert live <= set(second.said)
    assert len(live) > 200
    for stamp, estimate in second.said.items():
        assert estimate.orientation == expected[stamp].orientation
        assert estimate.heading_std == expected[stamp].heading_std


def test_without_an_answer_live_samples_are_taken_all_the_same(
    samples: list[tuple[str, Message]], tmp_path: Path
) -> None:
    life = Life(tmp_path, "soft")
    missed = Missed()
    for inlet in life.inlets.values():
        missed.hold(inlet, 0)
    for key, message in samples[:30]:
        life.take(key, message)
    assert missed.catch_up(lambda key, _: [], contextlib.nullcontext(), life.mute) == 0
    assert len(life.said) == sum(key == "imu/data_raw" for key, _ in samples[:30])


def test_an_answer_that_is_no_answer_costs_nothing_but_a_line(
    samples: list[tuple[str, Message]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one_bad_sample = b"\x92\xa1a\x91\xc4\x01\xc1"  # in an answer that is one: left out
    for answer in (b"", b"\xc1", b"\x92\x01", b"\x92\x01\x02", one_bad_sample):
        life = Life(tmp_path, "soft")
        missed = Missed()
        missed.hold(life.inlets["imu/data_raw"], 0)
        key, message = samples[0]
        life.take(key, message)
        answered = [("", answer)]
        missed.catch_up(lambda key, _, told=answered: told, threading.RLock(), life.mute)  # type: ignore[misc]
        assert len(life.said) == (key == "imu/data_raw")
        told = "MISSED imu/data_raw: " in capsys.readouterr().err
        assert told != (answer == one_bad_sample), answer


def test_a_sender_keeps_its_newest_samples_and_no_more() -> None:
    recent = Recent("me")
    for seq in range(NEWEST + 100):
        keep(recent, MagneticField(seq, (0.0, 0.0, 0.0), seq=seq))
    assert len(recent.answer()) < NEWEST * 80
    held = Inlet("mag", MagneticField, None, RecordingClock(), print, lambda sample: None)
    missed = Missed()
    missed.hold(held, 400)
    assert missed.catch_up(lambda key, _: [("", recent.answer())], threading.RLock(), ignore) == 211
    assert missed.gone == []


def test_who_missed_more_than_its_sender_keeps_is_told_so() -> None:
    recent = Recent("me")
    for seq in range(NEWEST + 100):
        keep(recent, MagneticField(seq, (0.0, 0.0, 0.0), seq=seq))
    for mark, gone in ((100, []), (98, ["mag"])):
        held = Inlet("mag", MagneticField, None, RecordingClock(), print, lambda sample: None)
        missed = Missed()
        missed.hold(held, mark)
        missed.catch_up(lambda key, _: [("", recent.answer())], threading.RLock(), ignore)
        assert missed.gone == gone


def test_a_question_that_gets_lost_is_put_again_and_not_waited_for() -> None:
    recent = Recent("me")
    patience: list[float] = []
    for seq in range(30):
        keep(recent, MagneticField(seq, (0.0, 0.0, 0.0), seq=seq))

    def ask(_key: str, seconds: float) -> list[tuple[str, bytes]]:
        patience.append(seconds)
        return [("", recent.answer())] if len(patience) == 3 else []

    held = Inlet("mag", MagneticField, None, RecordingClock(), print, lambda sample: None)
    missed = Missed()
    missed.hold(held, 9)
    assert missed.catch_up(ask, threading.RLock(), ignore) == 20
    assert sum(patience) < 0.5, "within which a killed attitude is to be back"


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "other fields"])
def test_a_damaged_state_is_named_and_the_node_starts_afresh(
    damage: str,
    samples: list[tuple[str, Message]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    life = uninterrupted(samples[:100], tmp_path, "soft")
    life.store()
    (file,) = tmp_path.iterdir()
    data = file.read_bytes()
    flipped = bytes([*data[:90], data[90] ^ 0x10, *data[91:]])
    other = b"\x92\x81\xa5other\x01\x80"
    broken = {
        "cut": data[:-9],
        "flip": flipped,
        "empty": b"",
        "other fields": zlib.crc32(other).to_bytes(4, "little") + other,
    }
    file.write_bytes(broken[damage])
    successor = Life(tmp_path, "soft")
    assert successor.keepsake.restore() is None
    assert "STATE_LOST attitude: " in capsys.readouterr().err
    assert successor.node.save().stamp is None


def test_a_state_that_is_forgotten_is_not_restored(
    samples: list[tuple[str, Message]], tmp_path: Path
) -> None:
    life = uninterrupted(samples[:100], tmp_path, "soft")
    life.store()
    life.keepsake.forget()
    assert Life(tmp_path, "soft").keepsake.restore() is None
