"""Orientation from gyro, accelerometer and magnetometer: several methods behind one interface."""

from collections.abc import Mapping
from typing import Any

from lodeline.attitude.base import Attitude, AttitudeParams
from lodeline.attitude.compass import Compass, TiltCompass
from lodeline.attitude.complementary import Complementary
from lodeline.attitude.dcm import Dcm
from lodeline.attitude.gyro import Gyro
from lodeline.attitude.mekf import Mekf
from lodeline.attitude.soft import Soft
from lodeline.params import build, nearest

METHODS: Mapping[str, type[Attitude]] = {
    "soft": Soft,
    "mekf": Mekf,
    "dcm": Dcm,
    "gyro": Gyro,
    "compass": Compass,
    "tilt_compass": TiltCompass,
    "complementary": Complementary,
}

__all__ = ["METHODS", "Attitude", "AttitudeParams", "make_attitude"]


def make_attitude(method: str, **values: Any) -> Attitude:
    """A fresh estimator by the name of its method, with parameters by name.

    Raises ValueError, naming the nearest right word, for an unknown method, an unknown parameter
    or a value of the wrong type.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}{nearest(method, METHODS)}")
    estimator = METHODS[method]
    params, problems = build(estimator.Params, values)
    if problems:
        raise ValueError("; ".join(problem.text for problem in problems))
    return estimator(params)
