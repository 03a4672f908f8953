"""Claims about what comes in on a key: it is refused, counted by cause, and survived."""

from __future__ import annotations

from collections import Counter
from typing import Any

import msgpack
import pytest

from lodeline.inlet import ASK_AGAIN_NS, MOST_LOST, Inlet
from lodeline_msgs import Imu, pack

SECOND = 1_000_000_000
NOW = 1_800_000_000 * SECOND


class Bench:
    """An IMU edge at a fixed time, whose key belongs to `owners`."""

    def __init__(self, *owners: str) -> None:
        self.time = NOW
        self.owners = set(owners)
        self.rejected: Counter[str] = Counter()
        self.taken: list[Imu] = []
        self.inlet = Inlet(
            "imu",
            Imu,
            0.25,
            self,
            lambda cause: self.rejected.update([cause]),
            self.taken.append,
            (lambda source: source in self.owners) if owners else (lambda source: True),
        )

    def now(self) -> int:
        return self.time

    def saw(self, stamp: int) -> None:
        """A host's clock does not care."""

    def put(self, seq: int, ahead: float = 0.0, source: str = "") -> None:
        stamp = self.time + int(ahead * SECOND)
        self.inlet.take(pack(Imu(stamp, (0.0,) * 3, (0.0, 0.0, 9.81), seq=seq)), source)


def mangled(**values: Any) -> bytes:
    whole = {
        "stamp": NOW,
        "seq": 1,
        "angular_velocity": (0.0, 0.0, 0.0),
        "linear_acceleration": (0.0, 0.0, 9.81),
    }
    made: bytes = msgpack.packb({k: v for k, v in (whole | values).items() if v is not None})
    return made


GOOD = mangled()
BROKEN = {
    "not a number": (mangled(angular_velocity=(0.0, float("nan"), 0.0)), "not finite", "[1]: nan"),
    "infinite": (mangled(linear_acceleration=(0.0, 0.0, float("inf"))), "not finite", "[2]: inf"),
    "wrong type": (mangled(angular_velocity="fast"), "wrong type", "str where an array"),
    "too short": (mangled(angular_velocity=(0.0, 0.0)), "wrong length", "2 parts where 3"),
    "stamp of text": (mangled(stamp="now"), "wrong type", "Imu.stamp: str where int"),
    "no field": (mangled(linear_acceleration=None), "missing field", "'linear_acceleration' is"),
    "another message": (msgpack.packb({"stamp": 1, "left": 2}), "missing field", "is missing"),
    "truncated": (GOOD[:-5], "truncated", "incomplete input"),
    "empty": (b"", "truncated", "incomplete input"),
    "with a tail": (GOOD + b"\x00", "malformed", "extra data"),
    "deep": (b"\x91" * 5000 + b"\xc0", "malformed", "not msgpack"),
    "no UTF-8": (b"\x81\xa4\xff\xfe\xfd\xfc\x01", "malformed", "invalid start byte"),
    "no map": (msgpack.packb([1, 2, 3]), "no map", "tuple where a map"),
    "a length that lies": (b"\xdd\xff\xff\xff\xff", "too large", "4294967295 exceeds"),
    "ten megabytes": (
        b"\xc6\x00\x98\x96\x80" + bytes(10_000_000),
        "too large",
        "payload of 10000005 bytes",
    ),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_sample_is_counted_its_fault_named_and_the_next_one_taken(kind: str) -> None:
    data, cause, words = BROKEN[kind]
    bench = Bench()
    bench.put(0)
    bench.inlet.take(data)
    bench.put(1)
    assert [sample.seq for sample in bench.taken] == [0, 1]
    assert bench.rejected == {cause: 1}
    assert words in bench.inlet.last_error
    (complaint,) = bench.inlet.complaints()
    assert complaint.state == "degraded"
    assert str(complaint).startswith(f"REFUSED imu: 1 refused, the last as {cause}: ")
    assert bench.inlet.complaints() == [], "what was said once is not said again"


def test_a_stamp_from_the_future_does_not_make_all_that_follow_look_old() -> None:
    bench = Bench()
    for seq, ahead in enumerate((0.0, 3600.0, 1e9, 0.24, 0.001)):
        bench.put(seq, ahead)
    assert [sample.seq for sample in bench.taken] == [0, 3, 4]
    assert bench.rejected == {"ahead": 2}
    assert "stamped 1e+09 s ahead of now" in bench.inlet.last_error


def test_a_number_far_ahead_is_no_loss_and_the_status_still_fits_the_wire() -> None:
    bench = Bench()
    for seq in (0, 2**64 - 1, 1, 2**64 - 1, 2):
        bench.time += 1000
        bench.put(seq)
    assert bench.inlet.lost == 0
    bench.put(3 + MOST_LOST, 0.1)
    assert bench.inlet.lost == MOST_LOST
    assert len(bench.taken) == 6


def test_a_late_burst_is_counted_as_late_not_as_lost() -> None:
    bench = Bench()
    bench.put(0)
    for seq in range(1, 681):
        bench.put(seq, -3.4)
    bench.put(681)
    assert (bench.inlet.late, bench.inlet.lost, len(bench.taken)) == (680, 0, 2)
    assert [str(item) for item in bench.inlet.complaints()] == ["LATE imu: 680 too old to use"]


def test_a_foreign_sender_is_refused_named_and_cannot_take_the_key_over() -> None:
    bench = Bench("node")
    for seq in range(3):
        bench.put(seq, source="node")
        bench.time += 5_000_000
        bench.put(1000 + seq, source="tool")
        bench.put(2000 + seq)
    assert [sample.seq for sample in bench.taken] == [0, 1, 2]
    assert bench.rejected == {"foreign": 6}
    assert "from a nameless sender" in bench.inlet.last_error
    bench.time += 3 * SECOND
    bench.put(3000, source="tool")
    assert len(bench.taken) == 3, "nor while the node is silent"
    assert "from tool, not the node's process" in bench.inlet.last_error
    bench.put(3, source="node")
    assert len(bench.taken) == 4


def test_a_restarted_sender_is_known_by_its_new_name_and_counts_anew() -> None:
    bench = Bench("first", "second")
    for seq in range(50):
        bench.put(seq, source="first")
        bench.time += 1000
    for seq in (0, 1, 5):  # it may start below and skip: only the skip is a loss
        bench.put(seq, source="second")
        bench.time += 1000
    assert len(bench.taken) == 53
    assert bench.inlet.lost == 3
    assert not bench.rejected


def test_a_sender_that_was_met_too_early_is_asked_for_again() -> None:
    bench = Bench("known")
    bench.put(0, source="late")
    bench.owners.add("late")
    bench.time += ASK_AGAIN_NS
    bench.put(1, source="late")
    assert [sample.seq for sample in bench.taken] == [1]
