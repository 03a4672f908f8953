"""The reed bar's driver: a bit is set where a reed is closed."""

from __future__ import annotations

from lodeline.devices.reed_bar import ReedBar, ReedBarParams
from tests.devices.rig import MakeRig


def test_nothing_closed_is_zero(rig: MakeRig) -> None:
    bench = rig(speed=0.0, magnet_pitch=10.0)
    assert ReedBar(bench.bus).read(0.0) == 0


def test_it_sees_the_reeds_that_magnets_close(rig: MakeRig) -> None:
    bench = rig()
    bar = ReedBar(bench.bus)
    got = bench.run(5.0, 100.0, lambda now: (bar.read(now), bench.robot.bar._pulled_low(now)))
    assert all(seen == true for _, (seen, true) in got)
    assert len({seen for _, (seen, _) in got}) > 5


def test_an_inverted_bar_has_its_bits_turned_round(rig: MakeRig) -> None:
    bench = rig(speed=0.0, magnet_pitch=10.0)
    assert ReedBar(bench.bus, ReedBarParams(inverted=True)).read(0.0) == 0xFF


def test_a_port_that_went_and_lost_its_latch_is_set_up_again(rig: MakeRig) -> None:
    bench = rig(speed=0.0, magnet_pitch=10.0)
    bar = ReedBar(bench.bus)
    bench.run(0.5, 100.0, bar.read)
    chip = bench.robot.bus.detach(0x20)
    bench.run(1.0, 100.0, bar.read)
    assert bar.health.state == "fault"
    assert bar.health.message.startswith("I2C_GONE bar: no answer at 0x20 on bus model")
    chip.write(b"\x00")  # all pins are low outputs: every reed would look closed
    bench.robot.bus.attach(0x20, chip)
    got = [closed for _, closed in bench.run(2.0, 100.0, bar.read) if closed is not None]
    assert set(got) == {0}
    assert bar.health.recovered == 1
