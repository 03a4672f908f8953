"""Claims about declared rates: what is off by a fifth or silent is named, what is well is not."""

from __future__ import annotations

import pytest

from lodeline.health import Gossip, Pace, worst


def judged(*rates: tuple[float, float], expected: float = 200.0) -> list[tuple[float, str]]:
    """(time, words) of each complaint on an output that sends at these rates for these seconds."""
    pace = Pace("rover/imu", expected, 0.0)
    now, total, last, said = 0.0, 0.0, 0.0, []
    for seconds, rate in rates:
        for _ in range(round(seconds)):
            now += 1.0
            total += rate
            last = now if rate else last
            if complaint := pace.judge(now, int(total), last):
                said.append((now, str(complaint)))
    return said


@pytest.mark.parametrize("part", [0.85, 1.0, 1.15])
def test_a_rate_within_a_fifth_is_well(part: float) -> None:
    assert judged((60, 200.0 * part)) == []


@pytest.mark.parametrize("part", [0.5, 0.75, 1.25, 2.0])
def test_a_wrong_rate_is_named_within_six_seconds_and_forgiven_within_six(part: float) -> None:
    said = judged((10, 200.0), (10, 200.0 * part), (10, 200.0))
    assert said[0][0] <= 16.0
    assert f"RATE rover/imu: {200 * part:.1f} Hz, 200 declared" in [text for _, text in said]
    assert said[-1][0] < 26.0


def test_a_rate_that_was_wrong_from_the_start_is_named_within_six_seconds() -> None:
    assert judged((6, 100.0))[0] == (5.0, "RATE rover/imu: 100.0 Hz, 200 declared")


def test_silence_is_named_at_the_next_look_and_counts_as_a_fault() -> None:
    said = judged((10, 200.0), (3, 0.0), (10, 200.0))
    assert said[0] == (11.0, "NO_DATA rover/imu: nothing for 1.0 s, 200 Hz declared")
    pace = Pace("k", 200.0, 0.0)
    complaint = pace.judge(10.0, 0, 0.0)
    assert complaint is not None
    assert complaint.state == "fault"


def test_a_slow_output_has_ten_of_its_own_periods() -> None:
    assert judged((60, 0.5), expected=0.5) == []
    pace = Pace("k", 0.5, 0.0)
    assert "NO_DATA" not in str(pace.judge(40.0, 10, 21.0))
    assert "NO_DATA" in str(pace.judge(41.5, 10, 21.0))


def test_the_gravest_state_counts() -> None:
    assert worst(["running", "fault", "degraded"]) == "fault"
    assert worst(["running", "degraded"]) == "degraded"


def test_one_line_in_thirty_seconds_about_the_same_thing() -> None:
    pace, gossip = Pace("k", 200.0, 0.0), Gossip()
    lines = []
    for now in range(100):
        complaint = pace.judge(float(now), 0, 0.0)
        lines += gossip.news([complaint] if complaint else [], float(now))
    assert len(lines) == 4
