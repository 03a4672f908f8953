"""The doctor finds what is wrong with a robot's bus and IMU, and has one line on how to cure it."""

from __future__ import annotations

import errno
import json
import os
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import msgpack.fallback
import pytest

from lodeline.cli import main
from lodeline.devices import CompassParams, MpuParams
from lodeline.doctor import bus as bus_checks
from lodeline.doctor.bus import check_bus, check_file, check_msgpack
from lodeline.doctor.imu import Clock, check_imu
from lodeline.doctor.report import Check, Report
from lodeline.doctor.wiring import Expected, Wiring, wiring_of
from lodeline.pipeline.load import load
from lodeline.run_folder import VARIABLE
from lodeline.sim.adapter import FUNCS
from lodeline.sim.chips.registers import RegisterChip
from tests.devices.rig import Rig

ROOT = Path(__file__).parents[2]


class Ina219(RegisterChip):
    """A power monitor as it is after power-on: 16-bit registers, configuration 0x399F."""

    def _begin(self, now: float) -> None:
        pass

    def _get(self, register: int) -> int:
        return {0x00: 0x39, 0x01: 0x9F}.get(register, 0)

    def _set(self, register: int, value: int) -> None:
        pass


@pytest.fixture
def expected() -> Wiring:
    """What the pipeline that ships expects."""
    return wiring_of(load(ROOT / "pipeline.yaml"))


def found(report: Report, name: str, verdict: str | None = None) -> Check:
    """The only check of that name (and verdict)."""
    checks = [c for c in report.checks if c.name == name and verdict in (None, c.verdict)]
    assert len(checks) == 1, [str(check) for check in report.checks]
    return checks[0]


def examine(bench: Rig, expected: Wiring) -> Report:
    report = Report()
    check_bus(report, bench.bus, expected.devices)
    return report


def try_imu(
    bench: Rig,
    params: MpuParams | None = None,
    field: float | None = None,
) -> Report:
    def sleep(seconds: float) -> None:
        bench.now += seconds

    report = Report()
    clock = Clock(bench.clock, sleep)
    check_imu(report, bench.bus, params or MpuParams(), CompassParams(), clock, field)
    return report


def test_every_bad_verdict_has_a_fix_and_every_good_one_none(
    rig: Callable[..., Rig], expected: Wiring
) -> None:
    broken = rig(speed=0.0, imu_chip="mpu6500")
    broken.robot.bus.detach(0x40)
    for report in (examine(broken, expected), try_imu(broken), examine(rig(), expected)):
        for number, check in enumerate(report.checks, 1):
            assert check.number == number
            assert bool(check.fix) == (check.verdict in ("warn", "FAIL")), str(check)
            assert "\n" not in check.fix


def test_a_healthy_robot_has_nothing_to_complain_of(
    rig: Callable[..., Rig], expected: Wiring
) -> None:
    report = examine(rig(), expected)
    assert not report.failed
    assert {check.verdict for check in report.checks} == {"ok", "skip"}
    text = found(report, "scan").text
    assert "0x20 port expander" in text
    assert "0x40 AS5048B encoder, 0x41 AS5048B encoder" in text
    assert "0x68 MPU-9250 (WHO_AM_I 0x71)" in text
    report = try_imu(rig(speed=0.0), field=47e-6)
    assert {check.verdict for check in report.checks} == {"ok"}


def test_a_device_that_is_missing_is_a_failure_and_errno_121_is_explained(
    rig: Callable[..., Rig], expected: Wiring
) -> None:
    bench = rig()
    bench.robot.bus.detach(0x41)
    report = examine(bench, expected)
    check = found(report, "encoders", "FAIL")
    assert check.text == "AS5048B right at 0x41: errno 121: nobody acknowledged that address"
    assert report.failed
    bench = rig()
    bench.robot.bus.attach(0x69, bench.robot.bus.detach(0x68))
    check = found(examine(bench, expected), "imu", "FAIL")
    assert check.fix.startswith("one answers at 0x69: set that address in the pipeline")


def test_an_ina219_in_the_place_of_an_encoder_is_told_from_it(
    rig: Callable[..., Rig], expected: Wiring
) -> None:
    bench = rig()
    bench.robot.bus.attach(0x40, Ina219(bench.clock))
    report = examine(bench, expected)
    check = found(report, "conflict")
    assert check.verdict == "FAIL"
    assert check.text == "an INA219 sits at 0x40, where the AS5048B left should be"
    assert "0x44" in check.fix
    assert "0x40 INA219 power monitor" in found(report, "scan").text


def test_an_address_that_the_kernel_holds_is_told(
    rig: Callable[..., Rig], expected: Wiring
) -> None:
    bench = rig()
    bench.fail = lambda address: errno.EBUSY if address == 0x68 else 0
    check = found(examine(bench, expected), "imu")
    assert check.verdict == "FAIL"
    assert check.text == "MPU at 0x68: held by a driver of the kernel"
    assert "dtoverlay" in check.fix


def test_an_encoder_whose_magnet_sits_badly_is_warned_of(
    rig: Callable[..., Rig], expected: Wiring
) -> None:
    bench = rig()
    bench.robot.right.flags = 0x09
    report = examine(bench, expected)
    check = found(report, "encoders", "warn")
    assert check.text == "AS5048B right at 0x41: AS5048B encoder, magnet too far"
    assert found(report, "encoders", "ok").text.startswith("AS5048B left")


@pytest.mark.parametrize("chip", ["mpu9250", "mpu9255", "mpu9150", "mpu6500", "mpu6050"])
def test_every_chip_that_can_be_driven_is_fine_where_an_imu_is_expected(
    rig: Callable[..., Rig], expected: Wiring, chip: str
) -> None:
    assert found(examine(rig(imu_chip=chip), expected), "imu").verdict == "ok"


def test_two_devices_that_want_one_address_are_a_conflict(rig: Callable[..., Rig]) -> None:
    report = Report()
    both = [Expected("left", "AS5048B", 0x40), Expected("right", "AS5048B", 0x40)]
    check_bus(report, rig().bus, both)
    assert found(report, "conflict").verdict == "FAIL"
    assert "left: AS5048B and right: AS5048B at 0x40" in found(report, "conflict").text


@pytest.mark.parametrize(
    ("number", "word"),
    [
        (errno.EREMOTEIO, "nobody answers at any address"),
        (errno.ETIMEDOUT, "errno 110: the bus does not come free: SDA or SCL is held low"),
    ],
)
def test_a_dead_bus_is_a_failure_and_says_how_dead(
    rig: Callable[..., Rig], expected: Wiring, number: int, word: str
) -> None:
    bench = rig()
    bench.fail = lambda address: number
    report = examine(bench, expected)
    assert found(report, "scan").verdict == "FAIL"
    assert found(report, "scan").text == word
    assert [check.name for check in report.checks][-1] == "scan", "no more is known then"


def test_a_device_file_that_is_missing_or_forbidden_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = Report()
    assert not check_file(report, 1, tmp_path)
    assert "raspi-config" in report.checks[-1].fix
    (tmp_path / "i2c-3").touch()
    assert not check_file(report, 1, tmp_path)
    assert "raspi-config" in report.checks[-1].fix, "or it is another one, as a screen's"
    assert "is it another one that is there: --bus 3?" in report.checks[-1].fix
    assert check_file(report, 3, tmp_path)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(bus_checks, "_group", lambda path: "i2c")
    assert not check_file(report, 3, tmp_path)
    check = report.checks[-1]
    assert (check.name, check.verdict) == ("rights", "FAIL")
    assert check.fix == "sudo usermod -aG i2c $USER, then log out and in"


@pytest.mark.parametrize(
    ("hertz", "verdict"), [(100_000, "warn"), (400_000, "ok"), (1_000_000, "ok")]
)
def test_a_slow_bus_is_warned_of(
    rig: Callable[..., Rig], tmp_path: Path, hertz: int, verdict: str
) -> None:
    bus = rig().bus
    bus.where = 1
    folder = tmp_path / "class/i2c-adapter/i2c-1/of_node"
    folder.mkdir(parents=True)
    (folder / "clock-frequency").write_bytes(hertz.to_bytes(4, "big"))
    report = Report()
    check_bus(report, bus, [], tmp_path)
    assert found(report, "bus speed").verdict == verdict
    report = Report()
    check_bus(report, bus, [], tmp_path / "elsewhere")
    assert found(report, "bus speed").verdict == "skip"


def test_an_adapter_without_plain_i2c_is_warned_of(
    rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig()
    bench.bus.funcs = type(bench.bus.funcs)(FUNCS & ~1)
    report = Report()
    check_bus(report, bench.bus, [])
    assert found(report, "adapter").verdict == "warn"


def test_msgpack_in_pure_python_is_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    report = Report()
    check_msgpack(report)
    assert report.checks[0].verdict == "ok"
    monkeypatch.setattr(msgpack, "Packer", msgpack.fallback.Packer)
    check_msgpack(report)
    assert report.checks[1].verdict == "warn"


def test_a_relabelled_board_is_unmasked(rig: Callable[..., Rig]) -> None:
    report = try_imu(rig(speed=0.0, imu_chip="mpu6500"))
    check = found(report, "chip")
    assert check.verdict == "warn"
    assert check.text == (
        "MPU-6500: no magnetometer (WHO_AM_I 0x70); a board sold as MPU-9250 with this chip was "
        "relabelled: it has no magnetometer"
    )
    assert found(report, "magnetometer").verdict == "skip"
    assert found(report, "gravity").verdict == "ok"


def test_an_unknown_chip_and_one_that_was_not_declared_are_failures(
    rig: Callable[..., Rig],
) -> None:
    bench = rig()
    bench.robot.imu._identity = 0x19
    report = try_imu(bench)
    assert found(report, "chip").text == "WHO_AM_I is 0x19, which is none that is known"
    assert report.failed
    report = try_imu(rig(), MpuParams(chip="mpu9255"))
    assert found(report, "declared chip").verdict == "FAIL"


def test_an_imu_at_the_other_address_is_hinted_at(rig: Callable[..., Rig]) -> None:
    report = try_imu(rig(), MpuParams(address=0x69))
    check = found(report, "chip")
    assert check.text == "nothing at 0x69: errno 121: nobody acknowledged that address"
    assert check.fix == "check its plug; with AD0 pulled low it is at 0x68"


def test_a_magnetometer_that_is_not_there_is_explained(rig: Callable[..., Rig]) -> None:
    bench = rig(speed=0.0)
    bench.robot.bus.detach(0x0C)
    check = found(try_imu(bench), "magnetometer")
    assert check.verdict == "FAIL"
    assert "no answer at 0x0c" in check.text
    assert check.text.endswith("the bypass is off, or there is no such chip on this board")


@pytest.mark.parametrize(
    ("robot", "name", "verdict"),
    [
        ({"hard_iron": (150e-6, 0.0, 0.0)}, "field strength", "warn"),
        ({"hard_iron": (0.0, 0.0, 50e-6)}, "field strength", "warn"),
        ({"accel_bias": (0.0, 0.0, 2.0)}, "gravity", "FAIL"),
        ({"gyro_bias": (0.0, 0.6, 0.0)}, "gyro at rest", "FAIL"),
        ({"gyro_noise": 0.1}, "stillness", "warn"),
    ],
)
def test_what_cannot_be_true_is_told(
    rig: Callable[..., Rig], robot: dict[str, Any], name: str, verdict: str
) -> None:
    assert found(try_imu(rig(speed=0.0, **robot)), name).verdict == verdict


def test_the_field_is_compared_with_the_one_expected_here(rig: Callable[..., Rig]) -> None:
    bench = rig(speed=0.0, hard_iron=(0.0, 0.0, 0.0))
    assert found(try_imu(bench, field=47e-6), "field strength").verdict == "ok"
    check = found(try_imu(bench, field=30e-6), "field strength")
    assert check.verdict == "warn"
    assert "expected 30.0 uT" in check.text


def test_a_bad_contact_shows_in_the_readings(rig: Callable[..., Rig]) -> None:
    bench = rig(speed=0.0)
    dice = random.Random(5)
    bench.fail = lambda address: 121 if bench.now > 0.5 and dice.random() < 0.5 else 0
    check = found(try_imu(bench), "readings")
    assert check.verdict == "warn"
    assert "I2C_NACK imu: 1 read failed (errno 121), retried" in check.text


def test_a_pipeline_tells_bus_and_addresses(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.yaml"
    file.write_text(
        "name: r\nnodes:\n  turns:\n    run: nodes/encoders.py\n    outputs: {wheels: wheels}\n"
        "    params: {bus: 3, encoders: {left_address: 66}}\n"
    )
    wiring = wiring_of(load(file))
    assert wiring.bus == 3
    assert wiring.devices == (
        Expected("turns", "AS5048B left", 0x42),
        Expected("turns", "AS5048B right", 0x41),
    )


def test_the_command_prints_numbered_checks_and_exits_with_1_on_a_failure(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(["doctor", "bus"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == " 1  skip  device file: a simulated bus has none"
    assert main(["doctor", "--bus", "99", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["fine"] is False
    first = said["checks"][0]
    assert (first["number"], first["name"], first["verdict"]) == (1, "device file", "FAIL")
    assert {check["verdict"] for check in said["checks"][1:]} == {"skip"}
    assert main(["doctor", "bus", "--bus", "/dev/null"]) == 1
    assert "FAIL  adapter: /dev/null is not an I2C bus" in capsys.readouterr().out


def test_the_simulated_robot_is_that_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "pipeline.yaml").read_text()
    (tmp_path / "nodes").symlink_to(ROOT / "nodes")
    broken = tmp_path / "pipeline.yaml"
    broken.write_text(text.replace("{seed: 1}", "{seed: 1, bar_chip: none}"))
    assert main(["doctor", "bus", "--pipeline", str(broken), "--json"]) == 1
    assert "0x20" in capsys.readouterr().out
    assert broken.read_text() != text


def test_the_command_tries_the_imu_of_a_simulated_robot(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(["doctor", "imu", "--json", "--field", "47"]) == 0
    said = json.loads(capsys.readouterr().out)
    names = [check["name"] for check in said["checks"]]
    assert names[-2:] == ["magnetometer", "field strength"]


@pytest.mark.parametrize("topic", ["net", "clock"])
def test_where_no_pipeline_runs_the_rest_is_still_looked_at(
    topic: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    main(["doctor", topic])
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(" 1  skip  pipeline: no pipeline runs here: start one")
    code = main(["doctor", topic, "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == (4 if said["fine"] else 1), "a port may be open on this machine"
    assert [check["name"] for check in said["checks"][1:]] == ["ports"] * len(said["checks"][1:])
    assert (len(said["checks"]) > 1) is (topic == "net")


@pytest.mark.parametrize(
    ("words", "advice"),
    [
        (["net", "--bus", "1"], "net looks at a pipeline that runs: --name chooses it"),
        (["imu", "--name", "rover"], "--name is for net and clock"),
    ],
)
def test_an_option_of_another_topic_is_refused(
    words: list[str], advice: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["doctor", *words])
    assert advice in capsys.readouterr().err
