"""The AK8963 magnetometer inside an MPU-9250, reached through the bypass.

Its die lies turned in the package: die (x, y, z) is (y, x, -z) of the gyro's axes, into which
every reading is converted here, before anything else sees it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Annotated

from lodeline.devices.link import DeviceError, Health, Link
from lodeline.i2c import Bus

WIA = 0x00
ST1 = 0x02
CNTL1 = 0x0A
CNTL2 = 0x0B
ASAX = 0x10

IDENTITY = 0x48
DATA_READY = 0x01
OVERFLOW = 0x08
POWER_DOWN = 0x00
FUSE_ACCESS = 0x1F
CONTINUOUS_100_HZ = 0x16  # 16 bit
SOFT_RESET = 0x01
TESLA_PER_LSB = 0.15e-6
CHECK_PERIOD = 0.1  # s
_DATA = struct.Struct("<3h")


@dataclass(frozen=True, slots=True)
class Ak8963Params:
    """Where the chip is; it has one address only."""

    address: Annotated[int, "1"] = 0x0C


class Ak8963:
    """The driver; 100 readings a second. A chip that does not answer shows in `health`.

    Ask it only when the gyro's driver delivers: until then the bypass is off.
    """

    def __init__(self, bus: Bus, params: Ak8963Params | None = None, name: str = "mag") -> None:
        self._bus = bus
        self._address = (params if params is not None else Ak8963Params()).address
        self._name = name
        self._scale = (TESLA_PER_LSB, TESLA_PER_LSB, TESLA_PER_LSB)
        self._check_s = float("-inf")
        self.overflows = 0
        self._link = Link(name, bus, self._address, (self._reset, self._measure))

    @property
    def health(self) -> Health:
        """How the chip does."""
        return self._link.health

    def read(self, now_s: float) -> tuple[float, float, float] | None:
        """Return a new field [T] in the gyro's axes, None if there is none or it overflowed."""
        link = self._link
        if not link.ready(now_s):
            return None
        if now_s >= self._check_s:
            self._check_s = now_s + CHECK_PERIOD
            measuring = link.attempt(now_s, self._is_measuring)
            if measuring is False:
                link.lost(now_s, f"MAG_RESET {self._name}: mode lost, reconfigured")
                link.ready(now_s)
            if not measuring:
                return None
        raw = link.attempt(now_s, self._burst)
        if raw is None or not raw[0] & DATA_READY:
            return None
        if raw[7] & OVERFLOW:
            self.overflows += 1
            link.health.tell(f"MAG_OVERFLOW {self._name}: field too strong, reading dropped")
            return None
        x, y, z = _DATA.unpack(bytes(raw[1:7]))
        sx, sy, sz = self._scale
        return (y * sy, x * sx, -z * sz)

    def _burst(self) -> list[int]:
        # ST1, the data and ST2 in one go: without ST2 the chip holds its data back for ever
        return self._bus.read_i2c_block_data(self._address, ST1, 8)

    def _is_measuring(self) -> bool:
        return self._bus.read_byte_data(self._address, CNTL1) == CONTINUOUS_100_HZ

    def _reset(self) -> float:
        got = self._bus.read_byte_data(self._address, WIA)
        if got != IDENTITY:
            text = f"got 0x{got:02x}, expected 0x{IDENTITY:02x} (AK8963)"
            raise DeviceError(f"MAG_ID {self._name}: {text} at 0x{self._address:02x}")
        self._bus.write_byte_data(self._address, CNTL2, SOFT_RESET)
        return 0.001

    def _measure(self) -> float:
        """Read the sensitivity from fuse ROM, then measure. Modes change through power-down."""
        bus, address = self._bus, self._address
        bus.write_byte_data(address, CNTL1, POWER_DOWN)
        bus.write_byte_data(address, CNTL1, FUSE_ACCESS)
        sx, sy, sz = (
            TESLA_PER_LSB * ((asa - 128) / 256.0 + 1.0)
            for asa in bus.read_i2c_block_data(address, ASAX, 3)
        )
        self._scale = (sx, sy, sz)
        bus.write_byte_data(address, CNTL1, POWER_DOWN)
        bus.write_byte_data(address, CNTL1, CONTINUOUS_100_HZ)
        return 0.0
