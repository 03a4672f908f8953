"""Claims about a slow link: it is named with what to do, and one that is only shaky is not."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.hosts.slowness import AGAIN_S, FRESH_S, LOOKS, Advice, Collect, Slowness
from lodeline_msgs import NodeStatus, pack

LOOK_S = 0.2


def status(node: str, host: str, rates: dict[str, float], sizes: dict[str, float]) -> bytes:
    made = NodeStatus(
        *(1, node, host, "running", 1, "abc", rates, sizes, {}, {}, {}, {}, {}, {}, 0, 0.0, 0),
        *("", 0.0),
    )
    return pack(made)


def test_a_slow_link_is_told_each_minute_with_what_it_takes() -> None:
    said: list[str] = []
    slowness = Slowness(said.append, lambda: "watch less")
    for place in range(700):
        slowness.look("10.0.0.2:1", place * LOOK_S, True, place * 5000)
        if place < LOOKS - 1:
            assert not said
    slow = "LINK_SLOW 10.0.0.2:1: it takes 25 kB/s and more is sent, samples get old or lost: "
    assert said == [slow + "watch less"] * 3
    now = 699 * LOOK_S
    assert now < 3 * AGAIN_S
    assert str(slowness.current(now + FRESH_S - 0.1)) == said[0]
    assert slowness.current(now + FRESH_S + 0.1) is None


def test_a_link_that_has_room_now_and_then_or_is_cut_is_not_slow() -> None:
    said: list[str] = []
    slowness = Slowness(said.append, lambda: "")
    for place in range(100):
        slowness.look("10.0.0.2:1", place * LOOK_S, place % LOOKS != 0, place * 5000)
        slowness.look("10.0.0.3:1", place * LOOK_S, False, 0)
        slowness.look("10.0.0.4:1", place * LOOK_S, True, 5000)  # a cut one takes nothing at all
    assert said == []
    assert slowness.current(20.0) is None


def test_the_largest_fast_keys_of_this_host_are_what_to_thin() -> None:
    rates = {"rover/imu": 200.0, "rover/odom": 100.0, "rover/pose": 10.0, "rover/mag": 100.0}
    sizes = {"rover/imu": 9e3, "rover/odom": 2e4, "rover/pose": 1e5, "rover/mag": 1e4}
    said = [
        status("a", "robot", rates, sizes),
        status("b", "laptop", {"rover/x": 50.0}, {"rover/x": 1e6}),
        b"no status",
    ]

    def collect_kept(key: str) -> Collect:
        assert key == "rover/status/*"

        def collect(take: Callable[[str, bytes, str], None]) -> None:
            for data in said:
                take(key, data, "")

        return collect

    thinned = {"rover/mag": 20.0}
    advice = Advice(collect_kept, "rover", "robot", thinned)
    assert advice() == "write `link_rate: {odom: 20, imu: 20}`"
    said.clear()
    assert Advice(collect_kept, "rover", "robot", {})() == "let fewer keys be watched over it"
