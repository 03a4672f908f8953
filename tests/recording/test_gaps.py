"""Claims about the gaps of a live recording: what senders still have is had, the rest counted."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path
from random import Random

import msgpack
import pytest

from lodeline.recent import KEPT_BYTES, KEPT_S, NEWEST, Recent, numbers, recent_key
from lodeline.recording.read import Recording
from lodeline.recording.record import Recorder
from lodeline.recording.summary import summarize
from lodeline_msgs import Imu, encoding_of, pack

KEY = "rover/imu/data"
SAMPLE_S = 0.005
SECOND = 200
"""Samples."""


def sample(seq: int, start: int = 1_000_000_000_000_000_000) -> Imu:
    return Imu(start + int(seq * SAMPLE_S * 1e9), (0.1, 0.2, 0.3), (0.0, 0.1, 9.8), seq=seq)


class Link:
    """A sender with what it kept, and the way to it, which may fail for a while."""

    def __init__(self, samples: list[Imu]) -> None:
        self.recent = Recent("sensors")
        for message in samples:
            self.recent.keep(message, pack(message))
        self.deaf = 0
        self.answers: list[int] = []

    def ask(self, key: str, question: bytes, _seconds: float) -> list[bytes]:
        assert key == recent_key(KEY)
        if self.deaf:
            self.deaf -= 1
            return []
        answer = self.recent.answer(question)
        self.answers.append(len(answer))
        return [answer]


def record(file: Path, link: Link, live: list[Imu]) -> Recorder:
    """A recorder that is fed `live` samples, and has asked for all between."""
    made = Recorder(file, "rover", {"imu/data": "Imu"}, {"pipeline": "rover"}, ask=link.ask)
    for message in live:
        made.take(KEY, pack(message), encoding_of(Imu))
    assert made.gaps is not None
    made.gaps.settle(10.0)
    return made


def test_a_gap_is_filled_in_pieces_and_every_sample_is_in_its_place(tmp_path: Path) -> None:
    all_of_it = [sample(seq) for seq in range(3100)]
    link = Link(all_of_it)
    link.deaf = 2
    made = record(tmp_path / "run.mcap", link, all_of_it[:50] + all_of_it[3050:])
    made.close("interrupted")
    assert made.gaps is not None
    assert made.gaps.news() == ["FILLED 3000 samples, lost on the way, had from their senders"]
    assert len(link.answers) > 20
    assert max(link.answers) < 5000  # a quarter of what it began with, after two silences
    with Recording(tmp_path / "run.mcap") as recording:
        packed = list(recording.packed())
        assert [each.data for each in packed] == [pack(message) for message in all_of_it]
        assert summarize(recording).keys["imu/data"].lost == 0
        assert recording.metadata["lost"] == "nothing"
        assert recording.metadata["filled"] == "3000 of imu/data"


def test_what_a_sender_has_no_more_is_counted_exactly(tmp_path: Path) -> None:
    link = Link([sample(seq) for seq in range(400, 1001)])
    made = record(tmp_path / "run.mcap", link, [sample(9), sample(1000)])
    made.close("interrupted")
    assert made.gaps is not None
    filled, lost = made.gaps.news()
    assert filled.startswith("FILLED 600 samples")
    assert lost == "LOST 390 of imu/data: not to be had from their senders"
    assert made.lost == {"imu/data": 390}
    with Recording(tmp_path / "run.mcap") as recording:
        assert summarize(recording).keys["imu/data"].lost == 390


def test_a_sender_that_was_restarted_fills_no_gap_of_its_predecessor(tmp_path: Path) -> None:
    later = 2_000_000_000_000_000_000
    link = Link([sample(seq, later) for seq in range(100)])
    made = record(tmp_path / "run.mcap", link, [sample(9), sample(50)])
    made.close("interrupted")
    assert made.lost == {"imu/data": 40}
    assert made.samples == 2


def test_a_sender_that_never_answers_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lodeline.recording.gaps.PATIENCE_S", 0.2)
    link = Link([])
    link.deaf = 1_000_000
    made = record(tmp_path / "run.mcap", link, [sample(0), sample(5)])
    assert made.gaps is not None
    assert made.gaps.news() == ["LOST 4 of imu/data: not to be had from their senders"]
    nonsense: bytes = msgpack.packb("nonsense")
    monkeypatch.setattr(link.recent, "answer", lambda _question: nonsense)
    link.deaf = 0
    made.take(KEY, pack(sample(8)), encoding_of(Imu))
    made.gaps.settle(10.0)
    made.close("interrupted")
    assert made.lost == {"imu/data": 6}


def test_a_gap_over_which_asking_fails_leaves_the_next_one_to_be_filled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    link = Link([sample(seq) for seq in range(30)])
    monkeypatch.setattr(link.recent, "answer", None)
    made = record(tmp_path / "run.mcap", link, [sample(0), sample(5)])
    assert made.gaps is not None
    assert made.gaps.news() == ["LOST 4 of imu/data: not to be had from their senders"]
    assert "GAP imu/data: TypeError" in capsys.readouterr().err
    monkeypatch.undo()
    made.take(KEY, pack(sample(8)), encoding_of(Imu))
    made.gaps.settle(10.0)
    made.close("interrupted")
    assert made.lost == {"imu/data": 4}


def test_a_sender_keeps_twenty_seconds_and_no_more_than_a_megabyte() -> None:
    small, large = Recent("me"), Recent("me")
    for seq in range(6000):
        small.keep(sample(seq), pack(sample(seq)))
        large.keep(sample(seq), bytes(1000))
        if seq % SECOND == 0:
            small.pack()
            large.pack()
    everything = numbers(0, 9999, 1 << 30)
    found, kept = (msgpack.unpackb(each.answer(everything))[1] for each in (small, large))
    # 15 s of a cut, and what it takes to ask; what is packed at once is forgotten at once
    assert KEPT_S / SAMPLE_S <= len(found) <= KEPT_S / SAMPLE_S + 2 * SECOND
    assert KEPT_BYTES - 1000 * SECOND < sum(map(len, kept)) <= KEPT_BYTES + 1000 * SECOND
    assert found == [pack(sample(seq)) for seq in range(6000 - len(found), 6000)]


def test_what_is_kept_takes_less_memory_than_it_has_bytes() -> None:
    noise = Random(7)
    messages = [
        replace(sample(seq), linear_acceleration=(noise.random(), noise.random(), noise.random()))
        for seq in range(4000)
    ]
    recent = Recent("me")
    tracemalloc.start()
    try:
        for message in messages:
            recent.keep(message, pack(message))
            if message.seq % SECOND == SECOND - 1:
                recent.pack()
        held, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert held < 0.6 * len(pack(messages[0])) * len(messages)
    assert msgpack.unpackb(recent.answer())[1] == [pack(message) for message in messages[-NEWEST:]]


@pytest.mark.parametrize("question", [b"\xc1", b"\x93\x01", b"\x92\x01\x02", b"\x93\xa1a\x01\x02"])
def test_a_question_that_makes_no_sense_is_answered_with_nothing(question: bytes) -> None:
    link = Link([sample(seq) for seq in range(10)])
    assert msgpack.unpackb(link.ask(recent_key(KEY), question, 1.0)[0]) == ["sensors", []]
