"""Other people's attitude filters behind our interface, where they are installed.

`pip install vqf imufusion ahrs filterpy`; what is missing is left out. Each starts as its makers
have it start, with their defaults; ahrs has no start of its own and gets gravity and north.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from math import degrees, sqrt
from typing import Any, Protocol

from lodeline.attitude.base import GRAVITY
from lodeline.attitude.fix import first_fix
from lodeline.rotation import Quaternion, Vector, conjugate, multiply

HALF = sqrt(0.5)
EAST_OF_NORTH: Quaternion = (0.0, 0.0, HALF, HALF)  # x north, y west turned to x east, y north
TESLA = 1e6  # uT


class Contender(Protocol):
    """What is measured: ours and theirs alike."""

    def update(
        self,
        dt: float,
        angular_velocity: Vector,
        linear_acceleration: Vector,
        magnetic_field: Vector | None = None,
    ) -> None: ...
    @property
    def orientation(self) -> Quaternion: ...


Maker = Callable[[float], Contender]
"""Makes a contender for samples so many seconds apart."""


class Vqf:
    """VQF with magnetometer (Laidig and Seel 2023); answers in east, north, up."""

    def __init__(self, period: float) -> None:
        import numpy as np

        self._array, self._filter = np.array, import_module("vqf").VQF(period)

    def update(self, dt: float, w: Vector, a: Vector, m: Vector | None = None) -> None:  # noqa: ARG002
        mag = None if m is None else self._array(m) * TESLA
        self._filter.update(self._array(w), self._array(a), mag)

    @property
    def orientation(self) -> Quaternion:
        return _xyzw(self._filter.getQuat9D())


class ImuFusion:
    """Fusion of x-io Technologies: a revised Madgwick filter that rejects; north, west, up."""

    def __init__(self, period: float) -> None:
        import numpy as np

        imufusion = import_module("imufusion")
        self._array, self._filter = np.array, imufusion.Ahrs()
        settings = imufusion.AhrsSettings(
            sample_rate=1.0 / period,
            convention=imufusion.CONVENTION_NWU,
            gyroscope_range=2000.0,
            acceleration_rejection=10.0,
            magnetic_rejection=10.0,
            rejection_timeout=5.0,
        )
        self._filter.set_settings(settings)

    def update(self, dt: float, w: Vector, a: Vector, m: Vector | None = None) -> None:  # noqa: ARG002
        gyro, accel = self._array(w) * degrees(1.0), self._array(a) / GRAVITY
        if m is None:
            self._filter.update_no_magnetometer(gyro, accel)
        else:
            self._filter.update(gyro, accel, self._array(m) * TESLA)

    @property
    def orientation(self) -> Quaternion:
        return multiply(EAST_OF_NORTH, _xyzw(self._filter.get_quaternion()))


class Madgwick:
    """Madgwick's filter as the package ahrs has it; answers with x north, y west, z up."""

    def __init__(self, period: float) -> None:
        import numpy as np

        self._array = np.array
        self._filter: Any = import_module("ahrs.filters").Madgwick(frequency=1.0 / period)
        self._q: Any = None

    def update(self, dt: float, w: Vector, a: Vector, m: Vector | None = None) -> None:
        if self._q is None:
            x, y, z, s = multiply(conjugate(EAST_OF_NORTH), first_fix(a, m, 0.0))
            self._q = self._array([s, x, y, z])
        gyro, accel = self._array(w), self._array(a)
        if m is None:
            self._q = self._filter.updateIMU(self._q, gyro, accel, dt=dt)
        else:
            mag = self._array(m) * TESLA * 1e3  # nT
            self._q = self._filter.updateMARG(self._q, gyro, accel, mag, dt=dt)

    @property
    def orientation(self) -> Quaternion:
        return multiply(EAST_OF_NORTH, _xyzw(self._q))


class FilterPy:
    """No attitude filter, a yardstick of cost: a Kalman filter as large as the one of `mekf`."""

    def __init__(self, period: float) -> None:  # noqa: ARG002
        import numpy as np
        from filterpy.kalman import KalmanFilter

        self._array, self._filter = np.array, KalmanFilter(dim_x=6, dim_z=3)
        self._filter.H = np.eye(3, 6)

    def update(self, dt: float, w: Vector, a: Vector, m: Vector | None = None) -> None:  # noqa: ARG002
        self._filter.predict()
        self._filter.update(self._array(w))

    @property
    def orientation(self) -> Quaternion:
        return (0.0, 0.0, 0.0, 1.0)


def installed() -> dict[str, Maker]:
    """Makers of the peers found here, by name; each takes the sampling period [s]."""
    found: dict[str, Maker] = {}
    if find_spec("vqf"):
        found["VQF"] = Vqf
    if find_spec("imufusion"):
        found["imufusion"] = ImuFusion
    if find_spec("ahrs"):
        found["ahrs Madgwick"] = Madgwick
    return found


def _xyzw(q: Any) -> Quaternion:
    w, x, y, z = (float(part) for part in q)
    return (x, y, z, w)
