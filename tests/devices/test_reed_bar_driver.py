"""The reed bar's driver: a bit is set where a reed is closed."""

from __future__ import annotations

import pytest

from lodeline.devices.reed_bar import ReedBar, ReedBarParams
from lodeline.sim.chips.mcp23017 import Mcp23017Chip
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


def test_an_mcp23017_reads_as_a_pcf8574_does(rig: MakeRig) -> None:
    bench = rig(bar_chip="mcp23017")
    bar = ReedBar(bench.bus, ReedBarParams(chip="mcp23017"))
    got = bench.run(5.0, 100.0, lambda now: (bar.read(now), bench.robot.bar._pulled_low(now)))
    assert all(seen == true for _, (seen, true) in got)
    assert len({seen for _, (seen, _) in got}) > 5
    assert bar.health.events == 0


def test_an_mcp23017_that_was_reset_is_set_up_again_at_once(rig: MakeRig) -> None:
    bench = rig(bar_chip="mcp23017", speed=0.0, magnet_pitch=10.0)
    bar = ReedBar(bench.bus, ReedBarParams(chip="mcp23017"))
    bench.run(0.5, 100.0, bar.read)
    assert isinstance(bench.robot.bar, Mcp23017Chip)
    bench.robot.bar.reset()  # pins float: all reeds look closed
    got = [closed for _, closed in bench.run(0.5, 100.0, bar.read)]
    assert got == [None] + [0] * 49
    assert bar.health.message == "BAR_RESET bar: registers lost, reconfigured"


@pytest.mark.parametrize("address", [0x20, 0x27, 0x38, 0x3F])
def test_a_pcf8574_or_pcf8574a_may_sit_at_any_of_its_addresses(rig: MakeRig, address: int) -> None:
    bench = rig()
    bench.robot.bus.attach(address, bench.robot.bus.detach(0x20))
    bar = ReedBar(bench.bus, ReedBarParams(address=address))
    assert all(closed is not None for _, closed in bench.run(1.0, 100.0, bar.read))
