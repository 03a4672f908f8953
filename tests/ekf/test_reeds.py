"""Claims about what readings of the reed bar say: the two ends of a passage, and its middle."""

import pytest

from lodeline.ekf.reeds import BarMemory, Contact, ReedModel, Sight, edge_sights, plain_sights

REEDS = ReedModel(passage=0.016, edge_sigma=0.001, lateral_sigma=0.003)


def passage(
    start: float, step: float, readings: int, sideways: float = 0.0
) -> list[tuple[float, list[Sight]]]:
    """The bar drives over a magnet at 0: (true place of the magnet ahead of it, sights) each."""
    memory, bar = BarMemory(), start
    seen = []
    for _ in range(readings):
        closed = (0.005,) if abs(bar) <= 0.008 else ()
        sights, contacts = edge_sights(REEDS, memory, closed)
        seen.append((-bar, sights))
        bar += step
        memory = BarMemory(contacts, abs(step) + sideways, step)
    return seen


@pytest.mark.parametrize("step", [0.0015, 0.003, 0.005, -0.0015, -0.003, -0.005])
@pytest.mark.parametrize("phase", [0.0, 0.0004, 0.0009])
def test_the_ends_of_a_passage_tell_the_place_within_the_last_step(
    step: float, phase: float
) -> None:
    start = -0.020 - phase if step > 0 else 0.020 + phase
    seen = [(true, sights) for true, sights in passage(start, step, 30) if sights]
    for true, sights in (seen[0], seen[-1]):
        assert abs(sights[0].offset - true) <= abs(step) / 2 + 1e-9
        assert sights[0].ahead_variance == pytest.approx(step**2 / 12 + 1e-6)
    for _, sights in seen[1:-1]:
        assert sights[0].offset == 0.0
    assert seen[-1][1][0].left_variance == 1.0  # m^2: a reed that opened says nothing across


def test_a_passage_is_worth_the_same_however_many_readings_it_has() -> None:
    """Across, all are one sight; ahead, those between its ends tell what the last step may have."""
    for step in (0.0005, 0.001, 0.002, 0.004):
        middle = [s[0] for _, s in passage(-0.02, step, 60) if s][1:-1]
        weight = sum(1.0 / sight.ahead_variance for sight in middle)
        single = 1.0 / (0.016**2 / 12 + 1e-6)
        assert 0.5 * step / 0.016 * single <= weight <= 1.01 * step / 0.016 * single
        closed = [s[0] for _, s in passage(-0.02, step, 60) if s][:-1]
        across = sum(1.0 / sight.left_variance for sight in closed)
        assert across == pytest.approx(1.0 / 0.003**2, rel=0.07)


def test_steps_longer_than_the_passage_make_the_plain_model() -> None:
    sights, _ = edge_sights(REEDS, BarMemory((), 0.02, 0.02), (0.005,))
    assert sights == plain_sights(REEDS, (0.005,))


def test_the_first_reading_knows_no_way() -> None:
    sights, _ = edge_sights(REEDS, BarMemory(), (0.005,))
    assert sights == plain_sights(REEDS, (0.005,))


def test_a_parked_robot_learns_nothing_from_the_same_magnet() -> None:
    contacts: tuple[Contact, ...] = ()
    _, contacts = edge_sights(REEDS, BarMemory(contacts, 0.003, 0.003), (0.0,))
    for _ in range(10):
        sights, contacts = edge_sights(REEDS, BarMemory(contacts, 0.0, 0.0), (0.0,))
        assert sights[0].ahead_variance > 0.1  # m^2


def test_a_reed_that_flickers_at_the_edge_is_not_a_second_passage() -> None:
    """Open for one reading at the far end: the magnet is not taken to come up again ahead."""
    contacts: tuple[Contact, ...] = ()
    for _ in range(5):
        _, contacts = edge_sights(REEDS, BarMemory(contacts, 0.003, 0.003), (0.0,))
    far_end, contacts = edge_sights(REEDS, BarMemory(contacts, 0.003, 0.003), ())
    assert far_end[0].offset < -0.008
    again, contacts = edge_sights(REEDS, BarMemory(contacts, 0.001, 0.001), (0.0,))
    assert again[0].offset == 0.0
    assert again[0].ahead_variance > plain_sights(REEDS, (0.0,))[0].ahead_variance


def test_a_robot_that_backs_out_has_not_passed() -> None:
    contacts: tuple[Contact, ...] = ()
    for step in (0.003, 0.002, -0.002):
        _, contacts = edge_sights(REEDS, BarMemory(contacts, abs(step), step), (0.0,))
    sights, _ = edge_sights(REEDS, BarMemory(contacts, 0.003, -0.003), ())
    assert sights == []


def test_turning_on_the_spot_has_no_near_end() -> None:
    sights, _ = edge_sights(REEDS, BarMemory((), 0.005, 0.001), (0.0,))
    assert sights[0].offset == 0.0


def test_two_magnets_are_followed_at_once() -> None:
    contacts: tuple[Contact, ...] = ()
    first, contacts = edge_sights(REEDS, BarMemory(contacts, 0.004, 0.004), (-0.03,))
    both, contacts = edge_sights(REEDS, BarMemory(contacts, 0.004, 0.004), (-0.03, 0.025))
    assert first[0].offset == pytest.approx(0.006)
    assert [sight.offset for sight in both] == pytest.approx([0.0, 0.006])
    assert len(contacts) == 2


def test_a_reed_that_sticks_is_not_believed_for_longer_than_a_passage() -> None:
    contacts: tuple[Contact, ...] = ()
    believed = 0.0
    for _ in range(100):
        sights, contacts = edge_sights(REEDS, BarMemory(contacts, 0.004, 0.004), (0.02,))
        believed += 0.004 if sights else 0.0
    assert believed == pytest.approx(0.016, abs=0.0001)
    sights, contacts = edge_sights(REEDS, BarMemory(contacts, 0.004, 0.004), ())
    assert sights == []
