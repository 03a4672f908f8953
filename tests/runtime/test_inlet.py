"""Claims about where samples enter: gaps are counted, old and double samples kept out."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.clock import HostClock, RecordingClock
from lodeline.inlet import Inlet
from lodeline_msgs import WheelTicks, pack

SECOND = 1_000_000_000


class Fixed:
    """A clock that stands where it is put."""

    def __init__(self, now: int) -> None:
        self.time = now

    def now(self) -> int:
        return self.time

    def saw(self, stamp: int) -> None:
        """It does not care."""


class Bench:
    """An inlet with its surroundings."""

    def __init__(self, max_age: float | None = None, now: int = 100 * SECOND) -> None:
        self.clock = Fixed(now)
        self.rejected: Counter[str] = Counter()
        self.taken: list[WheelTicks] = []
        self.inlet = Inlet(
            "wheels", WheelTicks, max_age, self.clock, self.reject, self.taken.append
        )

    def reject(self, cause: str) -> None:
        self.rejected[cause] += 1

    def put(self, seq: int, stamp: int) -> None:
        self.inlet.take(pack(WheelTicks(stamp, 0, 0, seq=seq)))


def test_a_gap_in_the_numbers_is_counted_exactly() -> None:
    bench = Bench()
    for seq in (4, 5, 9, 10):
        bench.put(seq, seq * SECOND)
    assert (bench.inlet.received, bench.inlet.lost) == (4, 3)


def test_joining_late_is_no_loss() -> None:
    bench = Bench()
    bench.put(5000, SECOND)
    assert bench.inlet.lost == 0


@given(st.lists(st.booleans(), min_size=1, max_size=200))
def test_reported_loss_is_the_true_loss(arrives: list[bool]) -> None:
    bench = Bench()
    bench.put(0, 1)
    for seq, comes in enumerate([*arrives, True], 1):
        if comes:
            bench.put(seq, seq + 1)
    assert bench.inlet.lost == arrives.count(False)


def test_a_duplicate_is_refused_and_counted() -> None:
    bench = Bench()
    bench.put(1, SECOND)
    bench.put(1, SECOND)
    assert len(bench.taken) == 1
    assert bench.rejected == {"duplicate": 1}


def test_an_overtaken_sample_is_refused_and_counted() -> None:
    bench = Bench()
    for seq in (1, 3, 2):
        bench.put(seq, seq * SECOND)
    assert [sample.seq for sample in bench.taken] == [1, 3]
    assert bench.rejected == {"reordered": 1}


def test_a_restarted_sender_counts_anew_without_a_false_loss() -> None:
    bench = Bench()
    for seq in range(50):
        bench.put(seq, seq)
    for seq in range(3, 20):
        bench.put(seq, 1000 + seq)
    assert bench.inlet.received == 67
    assert bench.inlet.lost == 0
    assert not bench.rejected


def test_a_sample_older_than_the_edge_allows_is_late_not_taken() -> None:
    bench = Bench(max_age=0.25)
    bench.put(0, bench.clock.time - SECOND // 4)
    bench.put(1, bench.clock.time - SECOND // 4 - 1)
    assert [sample.seq for sample in bench.taken] == [0]
    assert bench.inlet.late == 1
    assert bench.inlet.drain_ages() == pytest.approx([0.25, 0.25], abs=1e-8)
    assert bench.inlet.drain_ages() == []


def test_by_the_clock_of_a_recording_age_counts_from_the_newest_sample() -> None:
    clock = RecordingClock()
    taken: list[WheelTicks] = []
    old, new = (
        Inlet(key, WheelTicks, 0.25, clock, lambda cause: None, taken.append) for key in "ab"
    )
    new.take(pack(WheelTicks(10 * SECOND, 0, 0)))
    old.take(pack(WheelTicks(9 * SECOND, 0, 0)))
    assert (new.received, old.received, old.late) == (1, 0, 1)


def test_one_stamp_far_ahead_does_not_carry_the_clock_of_a_recording_away() -> None:
    clock = RecordingClock()
    taken: list[int] = []
    inlet = Inlet(
        "a", WheelTicks, 0.25, clock, lambda _: None, lambda sample: taken.append(sample.seq)
    )
    hole = 3600 * SECOND
    stamps = [10.0, 10.1, 1e9, 1e9 + 0.1, 10.2, 10.3, 10.3 + 3600, 10.4 + 3600]
    for seq, stamp in enumerate(stamps):
        inlet.take(pack(WheelTicks(int(stamp * SECOND), 0, 0, seq=seq)))
    assert taken == list(range(len(stamps)))
    assert clock.now() == int(10.4 * SECOND) + hole


def test_a_sample_from_before_a_hole_that_is_long_past_is_late() -> None:
    clock = RecordingClock()
    inlet = Inlet("a", WheelTicks, 0.25, clock, lambda _: None, lambda _: None)
    straggler = Inlet("b", WheelTicks, 0.25, clock, lambda _: None, lambda _: None)
    for tenth in [*range(100, 110), *range(600, 700)]:  # 10 s on, and 60 s on after the hole
        inlet.take(pack(WheelTicks(tenth * SECOND // 10, 0, 0, seq=tenth)))
    straggler.take(pack(WheelTicks(108 * SECOND // 10, 0, 0)))
    assert (straggler.received, straggler.late) == (0, 1)
    assert clock.now() == 699 * SECOND // 10


def test_what_cannot_be_decoded_is_counted_and_named() -> None:
    bench = Bench()
    bench.inlet.take(b"\xc1")
    bench.put(0, 1)
    assert bench.rejected == {"malformed": 1}
    assert "not msgpack" in bench.inlet.last_error
    assert len(bench.taken) == 1


def test_the_host_clock_never_steps_with_the_wall_clock() -> None:
    clock = HostClock(epoch_offset=5 * SECOND)
    first, second = clock.now(), clock.now()
    assert 0 <= second - first < SECOND
