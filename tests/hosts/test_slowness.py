"""Claims about a slow link: it is named with what to do, and one that is only shaky is not."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.hosts.slowness import AGAIN_S, FRESH_S, LOOKS, Advice, Collect, Slowness, fitting
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
    slowness = Slowness(said.append, lambda takes: f"watch less than {takes / 1e3:.0f} kB")
    for place in range(700):
        slowness.look("10.0.0.2:1", place * LOOK_S, True, place * 5000)
        if place < LOOKS - 1:
            assert not said
    slow = (
        "LINK_SLOW 10.0.0.2:1: it takes 25 kB/s and more is sent, samples get old or lost: watch "
    )
    assert said == [slow + "less than 25 kB"] * 3
    now = 699 * LOOK_S
    assert now < 3 * AGAIN_S
    assert str(slowness.current(now + FRESH_S - 0.1)) == said[0]
    assert slowness.current(now + FRESH_S + 0.1) is None


def test_a_link_that_has_room_now_and_then_or_is_cut_is_not_slow() -> None:
    said: list[str] = []
    slowness = Slowness(said.append, lambda _: "")
    for place in range(100):
        slowness.look("10.0.0.2:1", place * LOOK_S, place % LOOKS != 0, place * 5000)
        slowness.look("10.0.0.3:1", place * LOOK_S, False, 0)
        slowness.look("10.0.0.4:1", place * LOOK_S, True, 5000)  # a cut one takes nothing at all
    assert said == []
    assert slowness.current(20.0) is None


def test_looks_of_a_connection_that_was_cut_do_not_count_for_the_next() -> None:
    said: list[str] = []
    slowness = Slowness(said.append, lambda _: "")
    for place in range(LOOKS + 5):
        slowness.look("10.0.0.2:1", place * LOOK_S, True, 1_000_000)  # cut: takes nothing
    back = (LOOKS + 5) * LOOK_S
    for place in range(LOOKS - 1):
        slowness.look("10.0.0.2:1", back + place * LOOK_S, True, 1000 * place)
    later = back + 3600.0
    for place in range(LOOKS - 1):
        slowness.look("10.0.0.2:1", later + place * LOOK_S, True, 2_000_000 + 1000 * place)
    assert said == []


def test_links_that_are_no_more_are_forgotten() -> None:
    slowness = Slowness(lambda _: None, lambda _: "")
    for port in range(1000):
        slowness.look(f"10.0.0.2:{port}", port * 10.0, False, 0)
    assert len(slowness._looks) <= AGAIN_S / 10.0 + 2


def advice(thinned: dict[str, float], *crossing: str, told: bool = True) -> Advice:
    """For a robot that sends 40 kB/s of IMU, 20 of odometry, and more."""
    rates = {"rover/imu": 200.0, "rover/odom": 100.0, "rover/pose": 10.0, "rover/wheels": 100.0}
    sizes = {"rover/imu": 4e4, "rover/odom": 2e4, "rover/pose": 2e3, "rover/wheels": 1e4}
    said = [
        status("a", "robot", rates, sizes),
        status("b", "laptop", {"rover/x": 50.0}, {"rover/x": 1e6}),
        b"no status",
    ]

    def collect_kept(key: str) -> Collect:
        assert key == "rover/status/*"

        def collect(take: Callable[[str, bytes, str], None]) -> None:
            for data in said if told else []:
                take(key, data, "")

        return collect

    return Advice(collect_kept, "rover", "robot", thinned, crossing)


def test_only_keys_that_cross_are_named_with_a_rate_at_which_they_fit() -> None:
    of_nodes = advice({}, "rover/imu", "rover/pose", "rover/nothing")
    assert of_nodes(30e3) == "write `link_rate: {imu: 50}`"  # 12 of 18 kB/s; at 100 Hz 22
    assert of_nodes(10e3) == "write `link_rate: {imu: 20}`"  # 4 kB/s, and 2 of poses
    assert of_nodes(3e3) == "write `link_rate: {imu: 2, pose: 2}`"
    assert of_nodes(1e2) == "write `link_rate: {imu: 1, pose: 1}`"
    already = advice({"rover/imu": 20.0}, "rover/imu", "rover/odom")
    assert already(16e3) == "write `link_rate: {odom: 20}`"
    assert already(6e3) == "write `link_rate: {odom: 5, imu: 5}`"


def test_where_tools_alone_watch_all_is_named_and_the_reader_told_so() -> None:
    shown = "write what is watched there of `link_rate: {imu: 20, odom: 20, wheels: 20}`"
    assert advice({})(33e3) == shown
    assert advice({}, told=False)(33e3) == "let fewer keys be watched over it"


def test_what_is_proposed_fits() -> None:
    sent = {"imu": (200.0, 4e4), "odom": (100.0, 2e4)}
    rates = fitting(sent, 10e3)
    assert list(rates) == ["imu", "odom"]
    assert sum(sent[key][1] * rate / sent[key][0] for key, rate in rates.items()) <= 10e3
    assert fitting(sent, 70e3) == {"imu": 100.0}
