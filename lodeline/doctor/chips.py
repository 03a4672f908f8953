"""Naming the chips on an I2C bus by their addresses and by what they answer.

Only registers are read whose reading changes nothing. An address tells little: each chip may be
set to several, and many kinds share them.
"""

from __future__ import annotations

import errno

from smbus2 import I2cFunc

from lodeline.devices.as5048b import DIAGNOSTICS, OFFSETS_LOADED, TROUBLES
from lodeline.devices.mpu import WHO_AM_I
from lodeline.devices.mpu_models import MODELS
from lodeline.i2c import Bus

FIRST, LAST = 0x08, 0x77
SILENCE = (errno.EREMOTEIO, errno.ENXIO, errno.EIO)  # adapters disagree on what it is
HELD = "held by a driver of the kernel"
# Here a quick write might change an EEPROM or a clock, so they are read: as i2cdetect does.
READ_ONLY = (*range(0x30, 0x38), *range(0x50, 0x60))
AKM_IDENTITY = 0x48
INA219_AFTER_RESET = 0x399F
CANDIDATES = {
    0x0C: "AK8963 or AK8975 magnetometer",
    0x1E: "HMC5883L magnetometer",
    0x29: "VL53L0X distance sensor, or BNO055",
    0x3C: "SSD1306 display",
    0x48: "ADS1115 or PCF8591 converter",
    0x70: "TCA9548A multiplexer, or all PCA9685",
    0x76: "BMP280 or BME280",
}


def scan(bus: Bus) -> dict[int, str]:
    """Return what answers, by address. An OSError that concerns the whole bus is raised."""
    found = {}
    quick = bool(bus.funcs & I2cFunc.SMBUS_QUICK)
    for address in range(FIRST, LAST + 1):
        try:
            if quick and address not in READ_ONLY:
                bus.write_quick(address)
            else:
                bus.read_byte(address)
        except OSError as error:
            if error.errno == errno.EBUSY:
                found[address] = HELD
            elif error.errno not in SILENCE:
                raise
        else:
            found[address] = name_of(bus, address)
    return found


def name_of(bus: Bus, address: int) -> str:
    """Say what probably is at an address that acknowledged."""
    if address in (0x68, 0x69):
        return _mpu(bus, address)
    if address == 0x0C:
        got = _byte(bus, address, 0x00)
        return CANDIDATES[0x0C] if got == AKM_IDENTITY else f"unknown (WIA 0x{got or 0:02x})"
    if 0x40 <= address <= 0x4F:
        return _forties(bus, address)
    if 0x20 <= address <= 0x27:
        return "port expander: PCF8574 or MCP23017"
    if 0x38 <= address <= 0x3B or 0x3E <= address <= 0x3F:
        return "port expander: PCF8574A"
    return CANDIDATES.get(address, "unknown")


def _mpu(bus: Bus, address: int) -> str:
    got = _byte(bus, address, WHO_AM_I)
    names = [model.name for model in MODELS.values() if model.identity == got]
    if names:
        return f"{' or '.join(names)} (WHO_AM_I 0x{got:02x})"
    return f"unknown: a DS3231 clock, or no MPU (WHO_AM_I 0x{got or 0:02x})"


def _forties(bus: Bus, address: int) -> str:
    config = _block(bus, address, 0x00, 2)
    if config is not None and config[0] << 8 | config[1] == INA219_AFTER_RESET:
        return "INA219 power monitor"
    flags = _byte(bus, address, DIAGNOSTICS)
    if address <= 0x43 and flags is not None and flags & ~0x0F == 0 and flags & OFFSETS_LOADED:
        trouble = TROUBLES.get(flags & ~OFFSETS_LOADED)
        return f"AS5048B encoder, {trouble}" if trouble else "AS5048B encoder"
    return CANDIDATES.get(address, "unknown: INA219, PCA9685, or an encoder without power")


def _byte(bus: Bus, address: int, register: int) -> int | None:
    got = _block(bus, address, register, 1)
    return None if got is None else got[0]


def _block(bus: Bus, address: int, register: int, length: int) -> list[int] | None:
    try:
        return bus.read_i2c_block_data(address, register, length)
    except OSError:
        return None
