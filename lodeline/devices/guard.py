"""What keeps false samples of an inertial sensor from getting out: stuck and clipped ones.

A chip says by its data-ready flag whether it has measured since it was last asked. One that says
so and reads the very same numbers again is in doubt: noise is larger than resolution, so that is
chance once in a thousand times, and then the sample left out said nothing that the one before did
not. A reading at the end of its range is too small by nobody knows how much.
"""

from __future__ import annotations

import struct
from math import exp, pi, sqrt

from lodeline.devices.link import Health

STUCK_AFTER = 25  # identical readings in a row
TOLERATED = 2  # of these, where noise is so small against the resolution that they may be chance
SILENT_AFTER = 0.12  # s without a new measurement
SILENT_PERIODS = 3
CLIP_TIME = 0.2  # s without a clipped reading until all is well again
LSB = 1.0 / 32768.0  # parts of the full scale
NOISY = 3.0  # LSB of noise from which on a sensor alone does not repeat itself by chance
GYRO_NOISE = 0.01  # deg/s per sqrt(Hz), typical of these chips
ACCEL_NOISE = 300e-6  # g per sqrt(Hz)
_TRIPLE = struct.Struct(">3h")


class Repeats:
    """Counts how often in a row the same bytes were read."""

    def __init__(self) -> None:
        self._last = b""
        self.count = 0
        self.since_s = 0.0

    def take(self, now_s: float, data: bytes) -> int:
        """Return how many readings in a row were like this one, itself not counted."""
        if data == self._last:
            self.count += 1
        else:
            self._last, self.count, self.since_s = data, 0, now_s
        return self.count


class Guard:
    """Looks at the 14 bytes of each sample: accelerometer, thermometer, gyro."""

    def __init__(
        self,
        name: str,
        health: Health,
        ranges: tuple[int, int],
        bandwidth: float,
        sample_rate: float,
    ) -> None:
        """Take the ranges [deg/s, g] and the bandwidth [Hz], which say how much noise there is,

        and how often the chip measures [Hz].
        """
        gyro_range, accel_range = ranges
        self._name = name
        self._health = health
        self._ranges = {"gyro": f"{gyro_range} deg/s", "accelerometer": f"{accel_range} g"}
        # a first-order filter lets that much through, of which that part is new with each sample
        spread = sqrt(1.57 * bandwidth * (1.0 - exp(-2.0 * pi * bandwidth / sample_rate)))
        self._noisy = {
            "gyro": GYRO_NOISE * spread > NOISY * gyro_range * LSB,
            "accelerometer": ACCEL_NOISE * spread > NOISY * accel_range * LSB,
        }
        self._tolerated = 0 if any(self._noisy.values()) else TOLERATED
        self._repeats = {"sample": Repeats(), "gyro": Repeats(), "accelerometer": Repeats()}
        self._clipped_s = float("-inf")
        self._fresh_s = float("inf")
        self._silent = max(SILENT_AFTER, SILENT_PERIODS / sample_rate)
        self.stuck = self.clipped = 0  # samples held back

    def alive(self, now_s: float) -> None:
        """Note that the chip measures, or just began to."""
        self._fresh_s = now_s

    def nothing(self, now_s: float) -> None:
        """Note that the chip has not measured since it was last asked."""
        silent = now_s - self._fresh_s
        if silent > self._silent and self._health.state != "fault":
            self._health.state = "fault"
            self._health.tell(f"IMU_STUCK {self._name}: no new sample for {silent:.2f} s")

    def passes(self, now_s: float, data: bytes) -> bool:
        """Tell whether a new sample may go out; the health says why not."""
        self._fresh_s = now_s
        parts = {"gyro": data[8:14], "accelerometer": data[:6]}
        moving = self._moves(now_s, data, parts)
        stop = next((name for name, raw in parts.items() if _at_stop(raw)), None)
        if stop is not None:
            self._clip(now_s, stop)
        health = self._health
        if moving and health.state == "fault":
            health.state = "ok"
        if health.state == "degraded" and now_s - self._clipped_s >= CLIP_TIME:
            health.state = "ok"
        return moving and stop is None

    def _moves(self, now_s: float, data: bytes, parts: dict[str, bytes]) -> bool:
        worst, count = "sample", self._repeats["sample"].take(now_s, data)
        for name, raw in parts.items():
            repeats = self._repeats[name].take(now_s, raw) if self._noisy[name] else 0
            if repeats > count:
                worst, count = name, repeats
        again = count > self._tolerated
        if again:
            self.stuck += 1
        if count >= STUCK_AFTER - 1 and self._health.state != "fault":
            lasted = now_s - self._repeats[worst].since_s
            self._health.state = "fault"
            self._health.tell(f"IMU_STUCK {self._name}: {worst} unchanged for {lasted:.2f} s")
        return not again

    def _clip(self, now_s: float, which: str) -> None:
        self.clipped += 1
        self._clipped_s = now_s
        if self._health.state == "ok":
            code = "GYRO_CLIP" if which == "gyro" else "ACCEL_CLIP"
            text = f"{which} at the end of its {self._ranges[which]}: samples dropped"
            self._health.tell(f"{code} {self._name}: {text} - take a larger range")
            self._health.state = "degraded"


def _at_stop(raw: bytes) -> bool:
    x, y, z = _TRIPLE.unpack(raw)
    return bool(max(x, y, z) == 32767 or min(x, y, z) == -32768)
