"""Raw readings of sensors, as a calibration wants them: from a recording, a table or live samples.

A recording has them on keys that end in `data_raw` and `mag_raw` (chip axes, uncorrected); wheels
come as they are. A table has the columns of `lodeline.recording.imu_csv`, wheels are `left` and
`right`, cumulative.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from lodeline.recording import RecordingError, unreadable
from lodeline.recording.csv_table import CsvTable
from lodeline.recording.imu_csv import ACCEL, GYRO, MAG, MICROTESLA, TIME
from lodeline.rotation import Vector
from lodeline_msgs import Imu, MagneticField, Message, WheelTicks

Kind = Literal["gyro", "accel", "mag", "wheels"]
CLASSES: dict[str, tuple[type[Message], str]] = {
    "gyro": (Imu, "data_raw"),
    "accel": (Imu, "data_raw"),
    "mag": (MagneticField, "mag_raw"),
    "wheels": (WheelTicks, "wheels"),
}
COLUMNS = {
    "gyro": GYRO,
    "accel": (*GYRO, *ACCEL),
    "mag": MAG,
    "wheels": ("left", "right"),
}
MCAP_MAGIC = b"\x89MCAP0"


@dataclass(slots=True)
class Readings:
    """Samples in order; `times` [s] has one for each, the other lists those that the kind has.

    For the gyro `forces` and `counts` are what else tells a rest: empty where nothing does.
    """

    times: list[float] = field(default_factory=list)
    rates: list[Vector] = field(default_factory=list)
    forces: list[Vector] = field(default_factory=list)
    fields: list[Vector] = field(default_factory=list)
    counts: list[tuple[int, int]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """From the first sample to the last."""
        return self.times[-1] - self.times[0] if self.times else 0.0

    @property
    def rate(self) -> float:
        """Samples per second; 1 where time stands still."""
        return (len(self.times) - 1) / self.seconds if self.seconds > 0.0 else 1.0

    def take(self, message: Message) -> None:
        """Append a sample of the kind."""
        self.times.append(message.stamp * 1e-9)
        self.beside(message)

    def beside(self, message: Message) -> None:
        """Append a sample of something else that came meanwhile."""
        if isinstance(message, Imu):
            self.rates.append(message.angular_velocity)
            self.forces.append(message.linear_acceleration)
        elif isinstance(message, MagneticField):
            self.fields.append(message.magnetic_field)
        elif isinstance(message, WheelTicks):
            self.counts.append((message.left, message.right))


def read(file: Path, kind: Kind) -> Readings:
    """All readings of one kind in a file; RecordingError if it has none of them."""
    try:
        with file.open("rb") as stream:
            recorded = stream.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except OSError as error:
        raise unreadable(file, error) from None
    readings = _recorded(file, kind) if recorded else _tabled(file, kind)
    if not readings.times:
        raise RecordingError(f"{file}: no readings for a calibration of {kind}")
    return readings


def _recorded(file: Path, kind: Kind) -> Readings:
    from lodeline.recording.read import Recording

    cls, ending = CLASSES[kind]
    readings = Readings()
    with Recording(file) as recording:
        keys = [
            key
            for key, info in recording.channels.items()
            if info.type is cls and key.rpartition("/")[2] == ending
        ]
        if len(keys) != 1:
            there = ", ".join(recording.channels) or "no keys at all"
            found = f"several keys {', '.join(keys)}" if keys else f"no key .../{ending}"
            raise RecordingError(f"{file}: {found} ({cls.__name__}); it has {there}")
        wheels = [key for key, info in recording.channels.items() if info.type is WheelTicks]
        others = wheels if kind == "gyro" and len(wheels) == 1 else []
        for sample in recording.samples([*keys, *others]):
            (readings.take if sample.key in keys else readings.beside)(sample.message)
    return readings


def _tabled(file: Path, kind: Kind) -> Readings:
    readings = Readings()
    with CsvTable(file) as table:
        names = COLUMNS[kind]
        wanted = {"mag": MAG, "gyro": ACCEL}.get(kind, ())
        needed = (TIME,) if kind == "mag" else (TIME, *names)
        if kind == "mag" and (lacking := set(MAG) - set(table.columns)):
            table.fail(1, f"no column {min(lacking)}")
        for line, (t, *values) in table.rows(needed, wanted):
            numbers = [value for value in values if value is not None]
            if len(numbers) < len(names):
                continue  # no sample of the magnetometer in this row
            assert t is not None
            if readings.times and t < readings.times[-1]:
                table.fail(line, f"time goes back: {TIME} is {t:g}")
            readings.times.append(t)
            if kind == "wheels":
                readings.counts.append((round(numbers[0]), round(numbers[1])))
            elif kind == "mag":
                x, y, z = numbers
                readings.fields.append((x * MICROTESLA, y * MICROTESLA, z * MICROTESLA))
            else:
                x, y, z = numbers[:3]
                readings.rates.append((x, y, z))
                if len(numbers) == 6:
                    x, y, z = numbers[3:]
                    readings.forces.append((x, y, z))
    return readings
