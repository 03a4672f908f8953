"""Checks of an I2C bus: may we, does it work, who is there, are those there that should be."""

from __future__ import annotations

import grp
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import msgpack
from smbus2 import I2cFunc

from lodeline.doctor.chips import HELD, scan
from lodeline.doctor.report import Report, meaning
from lodeline.doctor.wiring import Expected
from lodeline.i2c import ENABLE, Bus

FAST = 400_000  # Hz
SLOW_FIX = "add dtparam=i2c_arm_baudrate=400000 to /boot/firmware/config.txt, and boot"
Open = Callable[[int | str], Bus]


def check_file(report: Report, bus: int | str, folder: Path = Path("/dev")) -> bool:
    """Whether the bus has a device file that we may use."""
    if bus == "sim":
        report.add("device file", "skip", "a simulated bus has none")
        return True
    path = folder / f"i2c-{bus}" if isinstance(bus, int) else Path(bus)
    if not path.exists():
        there = ", ".join(sorted(str(file) for file in folder.glob("i2c-*"))) or "none"
        fix = ENABLE
        if there != "none":  # on a Raspberry Pi those of its screens are always there
            fix += f"; or is it another one that is there: --bus {there.rpartition('-')[2]}?"
        report.add("device file", "FAIL", f"no {path} (there is: {there})", fix)
        return False
    report.add("device file", "ok", str(path))
    if not os.access(path, os.R_OK | os.W_OK):
        group = _group(path)
        fix = f"sudo usermod -aG {group} $USER, then log out and in"
        report.add("rights", "FAIL", f"{path} is for the group {group}, in which we are not", fix)
        return False
    report.add("rights", "ok", "we may read and write it")
    return True


def check_bus(
    report: Report, bus: Bus, expected: Sequence[Expected], folder: Path = Path("/sys")
) -> list[int]:
    """Check what is behind the device file; the addresses that answer."""
    if bus.funcs & I2cFunc.I2C and bus.funcs & I2cFunc.SMBUS_READ_I2C_BLOCK:
        report.add("adapter", "ok", "does plain I2C and block reads")
    else:
        text = "does SMBus only: the FIFO cannot be read through it"
        report.add("adapter", "warn", text, "leave `fifo: false`, or use another adapter")
    _check_speed(report, bus, folder)
    try:
        names = scan(bus)
    except OSError as error:
        fix = "take the power off the sensors and give it back; then look for a short or a bad plug"
        report.add("scan", "FAIL", meaning(error), fix)
        return []
    if not names:
        fix = "check 3.3 V and ground at the sensors, SDA on SDA (pin 3), SCL on SCL (pin 5)"
        report.add("scan", "FAIL", "nobody answers at any address", fix)
        return []
    listed = ", ".join(f"0x{address:02x} {name}" for address, name in names.items())
    report.add("scan", "ok", listed)
    _check_conflicts(report, names, expected)
    for device in expected:
        _check_expected(report, device, names)
    return list(names)


def check_msgpack(report: Report) -> None:
    """Whether messages are packed by compiled code."""
    if msgpack.Packer.__module__.endswith("fallback"):
        text = "pure Python, which costs some 30 times as much for each sample"
        fix = "unset MSGPACK_PUREPYTHON; pip install --force-reinstall --only-binary :all: msgpack"
        report.add("msgpack", "warn", text, fix)
    else:
        report.add("msgpack", "ok", "compiled")


def _group(path: Path) -> str:
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except KeyError:
        return "i2c"


def _check_speed(report: Report, bus: Bus, folder: Path) -> None:
    if not isinstance(bus.where, int):
        report.add("bus speed", "skip", "a simulated bus has none")
        return
    file = folder / f"class/i2c-adapter/i2c-{bus.where}/of_node/clock-frequency"
    try:
        speed = int.from_bytes(file.read_bytes(), "big")
    except OSError:
        report.add("bus speed", "skip", "this system does not tell")
        return
    text = f"{speed / 1000:g} kHz"
    if speed >= FAST:
        report.add("bus speed", "ok", text)
    else:
        busy = (27 + 18 * 9 + 2 * (18 + 9 + 5 * 9)) / speed * 200.0  # IMU and encoders at 200 Hz
        text += f": an IMU and two encoders at 200 Hz take {busy:.0%} of it, 1 kHz is out of reach"
        report.add("bus speed", "warn", text, SLOW_FIX)


def _check_conflicts(report: Report, names: dict[int, str], expected: Sequence[Expected]) -> None:
    taken: dict[int, list[str]] = {}
    for device in expected:
        taken.setdefault(device.address, []).append(f"{device.node}: {device.what}")
    double = {address: who for address, who in taken.items() if len(who) > 1}
    for address, who in double.items():
        text = f"the pipeline has {' and '.join(who)} at 0x{address:02x}"
        report.add("conflict", "FAIL", text, "give each device an address of its own")
    for device in expected:
        if device.what.startswith("AS5048B") and "INA219" in names.get(device.address, ""):
            text = f"an INA219 sits at 0x{device.address:02x}, where the {device.what} should be"
            fix = (
                "both come set to 0x40: close the INA219's bridge A0 (then it is 0x41) or A1 (0x44)"
            )
            report.add("conflict", "FAIL", text, fix)
            return
    if not double:
        report.add("conflict", "ok", "no address is wanted twice")


def _check_expected(report: Report, device: Expected, names: dict[int, str]) -> None:
    where = f"{device.what} at 0x{device.address:02x}"
    name = names.get(device.address)
    kind = device.what.partition(" ")[0]
    if name == HELD:
        fix = "take its dtoverlay (a clock has 0x68 too) out of /boot/firmware/config.txt, and boot"
        report.add(device.node, "FAIL", f"{where}: {name}", fix)
        return
    if name is not None and kind == "AS5048B" and "magnet" in name:
        fix = "the magnet belongs on the axis, 0.5 to 2.5 mm above the chip, with 30 to 70 mT there"
        report.add(device.node, "warn", f"{where}: {name}", fix)
        return
    if name is not None:
        fits = kind in name and "unknown" not in name
        fix = "" if fits else f"see what sits at 0x{device.address:02x}; the scan says what may be"
        report.add(device.node, "ok" if fits else "warn", f"{where}: {name}", fix)
        return
    same = [f"0x{there:02x}" for there, found in names.items() if kind in found]
    fix = "check its plug, and the solder bridges or pins that set its address"
    if same:
        fix = f"one answers at {', '.join(same)}: set that address in the pipeline, or its bridges"
    text = f"{where}: errno 121: nobody acknowledged that address"
    report.add(device.node, "FAIL", text, fix)
