"""Checks of an IMU: which chip it is and what it lacks, and whether what it says can be true."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import degrees, sqrt
from typing import NamedTuple

from lodeline.devices import CompassParams, DeviceError, ImuBoard, ImuReading, MpuParams
from lodeline.devices.mpu import WHO_AM_I
from lodeline.devices.mpu_models import MODELS
from lodeline.doctor.report import Report, meaning
from lodeline.i2c import Bus

Vector = tuple[float, float, float]
GRAVITY = 9.80665
GRAVITY_OFF = 0.6  # m/s^2, more than these accelerometers are off when new
STILL = 0.03  # rad/s of spread, more than their noise
LARGEST_BIAS = 0.35  # rad/s, what the data sheets allow at zero rate
EARTH = (25e-6, 65e-6)  # T, from the South Atlantic to the poles
FIELD_OFF = 0.2  # part of the expected field
RATE = 100.0  # Hz
RELABELLED = "a board sold as MPU-9250 with this chip was relabelled: it has no magnetometer"


class Clock(NamedTuple):
    """Time [s] and how to let it pass."""

    now: Callable[[], float]
    sleep: Callable[[float], object]


def check_imu(
    report: Report,
    bus: Bus,
    params: MpuParams,
    compass: CompassParams,
    clock: Clock,
    field: float | None = None,
    seconds: float = 2.0,
) -> None:
    """Check the IMU on an open bus, with the robot standing still; `field` [T] is expected."""
    if not _check_identity(report, bus, params):
        return
    try:
        board = ImuBoard(bus, clock.now, params, compass)
    except DeviceError as error:
        report.add("declared chip", "FAIL", str(error), "write `imu: {chip: auto}`, or swap it")
        return
    readings, fields = _run(board, clock, seconds)
    mpu = board.mpu.health
    if not readings:
        report.add("readings", "FAIL", mpu.message, "check its plug and its 3.3 V")
        return
    wanted = seconds * RATE
    text = f"{len(readings)} of {wanted:.0f} in {seconds:g} s"
    fine = len(readings) > 0.98 * wanted and mpu.state == "ok"
    fix = "" if fine else "shorter wires, one pair of pull-ups of 2.2 to 4.7 kOhm"
    report.add("readings", "ok" if fine else "warn", f"{text} {mpu.message}".strip(), fix)
    _check_sense(report, readings)
    _check_field(report, board, fields, field)


def _check_identity(report: Report, bus: Bus, params: MpuParams) -> bool:
    try:
        got = bus.read_byte_data(params.address, WHO_AM_I)
    except OSError as error:
        other = 0x69 if params.address == 0x68 else 0x68
        text = f"nothing at 0x{params.address:02x}: {meaning(error)}"
        level = "high" if other == 0x69 else "low"
        fix = f"check its plug; with AD0 pulled {level} it is at 0x{other:02x}"
        report.add("chip", "FAIL", text, fix)
        return False
    names = [model.name for model in MODELS.values() if model.identity == got]
    if not names:
        fix = "bad contact, or another chip: lodeline drives MPU-6050, 6500, 9150, 9250 and 9255"
        report.add("chip", "FAIL", f"WHO_AM_I is 0x{got:02x}, which is none that is known", fix)
        return False
    text = f"{' or '.join(names)} (WHO_AM_I 0x{got:02x})"
    if got == 0x70:
        fix = "use an MPU-9250 (0x71) or 9255 (0x73), or live with a heading that drifts"
        report.add("chip", "warn", f"{text}; {RELABELLED}", fix)
    else:
        report.add("chip", "ok", text)
    return True


def _run(board: ImuBoard, clock: Clock, seconds: float) -> tuple[list[ImuReading], list[Vector]]:
    """Bring the board up, and read it for some seconds."""
    readings: list[ImuReading] = []
    fields: list[Vector] = []
    begin = clock.now()
    ends = begin + 1.0 + seconds  # one that comes up late still gets its time
    tick = 0
    first: float | None = None
    while clock.now() < (ends if first is None else first + seconds):
        now = clock.now()
        samples, field = board.read(round(now * 1e9))
        if samples:
            first = now if first is None else first
            readings.append(samples[-1][1])
        if field is not None:
            fields.append(field)
        tick += 1
        clock.sleep(max(0.0, begin + tick / RATE - clock.now()))
    return readings, fields


def _check_sense(report: Report, readings: Sequence[ImuReading]) -> None:
    rates = [reading.angular_velocity for reading in readings]
    spread = max(_spread(axis) for axis in zip(*rates, strict=True))
    if spread > STILL:
        text = f"the gyro varies by {degrees(spread):.1f} deg/s: the robot is not still"
        report.add("stillness", "warn", text, "put it down, motors off, and ask again")
        return
    report.add("stillness", "ok", f"the gyro varies by {degrees(spread):.2f} deg/s")
    bias = _norm(_mean(rates))
    fine = bias < LARGEST_BIAS
    report.add(
        "gyro at rest",
        "ok" if fine else "FAIL",
        f"reads {degrees(bias):.2f} deg/s",
        "" if fine else "more than the data sheet allows: the chip is damaged, replace it",
    )
    force = _norm(_mean([reading.linear_acceleration for reading in readings]))
    fine = abs(force - GRAVITY) < GRAVITY_OFF
    report.add(
        "gravity",
        "ok" if fine else "FAIL",
        f"{force:.2f} m/s^2, expected {GRAVITY:.2f} +- {GRAVITY_OFF}",
        "" if fine else "calibrate the accelerometer; if it stays so, the chip is damaged",
    )


def _check_field(
    report: Report, board: ImuBoard, fields: Sequence[Vector], expected: float | None
) -> None:
    model = board.mpu.model
    if not model.compass:
        report.add("magnetometer", "skip", f"{model.name}")
        return
    health = board.compass.health if board.compass is not None else None
    if not fields:
        text = health.message if health is not None else ""
        if "errno 121" in text:
            text += ": the bypass is off, or there is no such chip on this board"
        fix = "leave the chip's AUX pins open; boards without it are told by a WHO_AM_I of 0x70"
        report.add("magnetometer", "FAIL", text, fix)
        return
    report.add("magnetometer", "ok", f"{model.compass}, {len(fields)} readings")
    strength = _norm(_mean(fields))
    low, high = EARTH
    text = f"{1e6 * strength:.1f} uT before calibration"
    if expected is not None:
        low, high = expected * (1.0 - FIELD_OFF), expected * (1.0 + FIELD_OFF)
        text += f", expected {1e6 * expected:.1f} uT"
    if low <= strength <= high:
        report.add("field strength", "ok", text)
        return
    fix = "turn the robot a full circle and calibrate; keep iron, magnets and motors off the board"
    report.add("field strength", "warn", f"{text}: iron or a magnet is near", fix)


def _mean(vectors: Sequence[Vector]) -> Vector:
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return x, y, z


def _norm(v: Vector) -> float:
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def _spread(values: Sequence[float]) -> float:
    mean = sum(values) / len(values)
    return sqrt(sum((value - mean) ** 2 for value in values) / len(values))
