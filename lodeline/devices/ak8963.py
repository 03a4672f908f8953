"""The magnetometers inside the nine-axis chips: AK8963 (MPU-9250, 9255) and AK8975 (MPU-9150).

They are reached through the bypass. The die lies turned in the package: die (x, y, z) is
(y, x, -z) of the gyro's axes, into which every reading is converted here, before anything else
sees it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Annotated, ClassVar

from lodeline.devices.guard import STUCK_AFTER, Repeats
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
SINGLE = 0x01
SOFT_RESET = 0x01
MODE_TIME = 0.001  # s in power-down between two modes; 0.1 ms is asked for
CHECK_PERIOD = 0.1  # s
SILENT_AFTER = 0.5  # s, when even the slowest would have measured dozens of times
_DATA = struct.Struct("<3h")


@dataclass(frozen=True, slots=True)
class CompassParams:
    """Where the chip is; these have one address only."""

    address: Annotated[int, "1"] = 0x0C


class Ak8963:
    """The driver; 100 readings a second. A chip that does not answer shows in `health`.

    Ask it only when the gyro's driver delivers: until then the bypass is off.
    """

    model: ClassVar[str] = "AK8963"
    tesla_per_lsb: ClassVar[float] = 0.15e-6
    fuse_access: ClassVar[int] = 0x1F
    measuring: ClassVar[int] = 0x16  # continuous, 100 Hz, 16 bit
    resettable: ClassVar[bool] = True

    def __init__(self, bus: Bus, params: CompassParams | None = None, name: str = "mag") -> None:
        self._bus = bus
        self._address = (params if params is not None else CompassParams()).address
        self._name = name
        self._scale = (self.tesla_per_lsb,) * 3
        self._check_s = float("-inf")
        self._fresh_s = float("inf")
        self._repeats = Repeats()
        self.overflows = 0
        self._link = Link(name, bus, self._address, (self._reset, self._read_fuses, self._measure))

    @property
    def health(self) -> Health:
        """How the chip does."""
        return self._link.health

    @property
    def absent(self) -> bool:
        """Whether nobody ever answered, however often it was asked."""
        return self._link.absent

    def read(self, now_s: float) -> tuple[float, float, float] | None:
        """Return a new field [T] in the gyro's axes, None if there is none or it overflowed."""
        link = self._link
        if not link.ready(now_s):
            self._fresh_s = now_s
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
        if raw is None or not self._is_fresh(now_s, raw):
            return None
        x, y, z = _DATA.unpack(bytes(raw[1:7]))
        sx, sy, sz = self._scale
        return (y * sy, x * sx, -z * sz)

    def _is_fresh(self, now_s: float, raw: list[int]) -> bool:
        """Tell whether what was read is a new measurement, and one to be believed."""
        health = self._link.health
        if not raw[0] & DATA_READY:
            if now_s - self._fresh_s > SILENT_AFTER and health.state == "ok":
                health.state = "fault"
                health.tell(f"MAG_SILENT {self._name}: {self.model} answers, but measures nothing")
            return False
        self._fresh_s = now_s
        if raw[7] & OVERFLOW:
            self.overflows += 1
            if health.state == "ok":
                health.tell(f"MAG_OVERFLOW {self._name}: field too strong, readings dropped")
                health.state = "degraded"
            return False
        repeats = self._repeats.take(now_s, bytes(raw[1:7]))
        if repeats >= STUCK_AFTER - 1 and health.state != "fault":
            health.tell(f"MAG_STUCK {self._name}: field unchanged over {repeats + 1} measurements")
            health.state = "fault"
        if repeats == 0:
            health.state = "ok"
        return repeats == 0

    def _burst(self) -> list[int]:
        # ST1, the data and ST2 in one go: without ST2 the chip holds its data back for ever
        return self._bus.read_i2c_block_data(self._address, ST1, 8)

    def _is_measuring(self) -> bool:
        return self._bus.read_byte_data(self._address, CNTL1) == self.measuring

    def _reset(self) -> float:
        got = self._bus.read_byte_data(self._address, WIA)
        if got != IDENTITY:
            text = f"got 0x{got:02x}, expected 0x{IDENTITY:02x} ({self.model})"
            raise DeviceError(f"MAG_ID {self._name}: {text} at 0x{self._address:02x}")
        self._bus.write_byte_data(self._address, CNTL1, POWER_DOWN)
        if self.resettable:
            self._bus.write_byte_data(self._address, CNTL2, SOFT_RESET)
        return MODE_TIME

    def _read_fuses(self) -> float:
        """Read the sensitivity from fuse ROM."""
        bus, address = self._bus, self._address
        bus.write_byte_data(address, CNTL1, self.fuse_access)
        sx, sy, sz = (
            self.tesla_per_lsb * ((asa - 128) / 256.0 + 1.0)
            for asa in bus.read_i2c_block_data(address, ASAX, 3)
        )
        self._scale = (sx, sy, sz)
        bus.write_byte_data(address, CNTL1, POWER_DOWN)
        return MODE_TIME

    def _measure(self) -> float:
        self._bus.write_byte_data(self._address, CNTL1, self.measuring)
        return 0.0


class Ak8975(Ak8963):
    """The older one measures when it is told to, and for 7 to 9 ms.

    So it is told again after each reading, and a lost order shows in that nothing is new.
    """

    model: ClassVar[str] = "AK8975"
    tesla_per_lsb: ClassVar[float] = 0.3e-6
    fuse_access: ClassVar[int] = 0x0F
    measuring: ClassVar[int] = SINGLE
    resettable: ClassVar[bool] = False

    def _burst(self) -> list[int]:
        raw = super()._burst()
        if raw[0] & DATA_READY:
            self._bus.write_byte_data(self._address, CNTL1, SINGLE)
        return raw

    def _is_measuring(self) -> bool:
        mode = self._bus.read_byte_data(self._address, CNTL1)
        # power-down is right where a measurement waits to be read
        return mode == SINGLE or bool(self._bus.read_byte_data(self._address, ST1) & DATA_READY)
