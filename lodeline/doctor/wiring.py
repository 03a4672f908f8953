"""Which devices a pipeline file expects on which I2C bus."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from lodeline.devices import CompassParams, MpuParams
from lodeline.pipeline.model import Pipeline

P = TypeVar("P")


class Expected(NamedTuple):
    """A device that a node of the pipeline is going to drive."""

    node: str
    what: str
    address: int


class Wiring(NamedTuple):
    """The bus that the drivers name (None: they name none) and what they expect on it."""

    bus: int | str | None
    devices: tuple[Expected, ...]
    imu: MpuParams
    compass: CompassParams


def wiring_of(pipeline: Pipeline) -> Wiring:
    """Read off the parameters of the drivers that have a `bus`; the first one's bus counts."""
    bus: int | str | None = None
    devices: list[Expected] = []
    imu, compass = MpuParams(), CompassParams()
    for spec in pipeline.nodes:
        here = getattr(spec.params, "bus", None)
        if here is None or bus not in (None, here):
            continue
        bus = here
        imu = _of(MpuParams, spec.params, "imu", imu)
        compass = _of(CompassParams, spec.params, "magnetometer", compass)
        for part, what in (("imu", "MPU"), ("encoders", "AS5048B"), ("bar", "expander")):
            params = getattr(spec.params, part, None)
            for name in ("address", "left_address", "right_address"):
                if (address := getattr(params, name, None)) is not None:
                    side = name.removesuffix("address").removesuffix("_")
                    devices.append(Expected(spec.name, f"{what} {side}".strip(), address))
    return Wiring(bus, tuple(devices), imu, compass)


def _of(kind: type[P], params: object, part: str, otherwise: P) -> P:
    found = getattr(params, part, None)
    return found if isinstance(found, kind) else otherwise
