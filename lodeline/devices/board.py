"""A board with an inertial chip and, if it has one, the magnetometer behind it."""

from __future__ import annotations

from collections.abc import Callable

from lodeline.devices.ak8963 import Ak8963, Ak8975, CompassParams
from lodeline.devices.link import Health
from lodeline.devices.mpu import ImuReading, Mpu
from lodeline.devices.mpu_fifo import MpuFifo
from lodeline.devices.mpu_models import MODELS, MpuParams
from lodeline.i2c import Bus
from lodeline.stamps import seconds

Field = tuple[float, float, float]
NANO = 1e9  # ns/s
COMPASSES = {"AK8963": Ak8963, "AK8975": Ak8975}


class ImuBoard:
    """Finds out which chip answers, and drives what it has.

    DeviceError on construction if it is not the one declared. A board without magnetometer is
    degraded: it can be used, but not for long know where north is. `clock` [s] is for the FIFO,
    which looks at it within a tick.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Callable[[], float],
        params: MpuParams | None = None,
        compass: CompassParams | None = None,
        name: str = "imu",
    ) -> None:
        params = params if params is not None else MpuParams()
        self.mpu = MpuFifo(bus, params, clock, name) if params.fifo else Mpu(bus, params, name)
        self.compass: Ak8963 | None = None
        self._compass_params = compass
        self._bus = bus

    def read(self, stamp: int) -> tuple[list[tuple[int, ImuReading]], Field | None]:
        """Return the samples there are, each with its stamp, and a field [T] if there is one.

        `stamp` [ns] is now. Samples are of when the gyro felt what they say. Without FIFO there is
        one at most, and the chip took it half a period ago on average.
        """
        now_s = seconds(stamp)
        mpu = self.mpu
        if isinstance(mpu, MpuFifo):
            taken = mpu.read_all(now_s)
        else:
            reading = mpu.read(now_s)
            t = now_s - 0.5 / mpu.params.sample_rate
            taken = [] if reading is None else [(t, reading)]
        readings = [(stamp + round((t - mpu.delay - now_s) * NANO), each) for t, each in taken]
        return readings, self._field(now_s) if self.mpu.link.up else None

    def _field(self, now_s: float) -> Field | None:
        kind = COMPASSES.get(self.mpu.model.compass)
        if kind is None:
            self.compass = None
            return None
        if type(self.compass) is not kind:
            self.compass = kind(self._bus, self._compass_params)
        field = self.compass.read(now_s)
        if self.mpu.params.chip == "auto" and self.compass.absent and kind is Ak8975:
            self.mpu.model = MODELS["mpu6050"]  # which differs from an MPU-9150 in this only
        return field

    @property
    def health(self) -> Health:
        """How the board does: without its gyro not at all, without its magnetometer less well."""
        mpu = self.mpu.health
        if mpu.state != "ok":
            return mpu
        model = self.mpu.model
        if not model.compass and self.mpu.link.up:
            text = f"IMU_CHIP {self.mpu.name}: {model.name}, heading from the gyro only"
            return Health(state="degraded", message=text, events=1)
        if self.compass is not None and self.compass.health.state != "ok":
            health = self.compass.health
            return Health("degraded", health.message, health.events)
        told = [part.health for part in (self.mpu, self.compass) if part and part.health.message]
        return told[0] if told else mpu
