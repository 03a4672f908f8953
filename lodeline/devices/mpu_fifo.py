"""Every sample of an MPU, out of its FIFO, with the time at which it was taken.

For 500 Hz and 1 kHz: one look every few samples, instead of a tick for each. At 1 kHz a bus of
400 kHz is busy for 40 % of the time; one of 100 kHz is too slow.

No sample goes out before it is known when it was taken. Where a look at the counter does not tell
that (as after the start), the counter is watched until it moves; if that does not do either,
samples wait in the FIFO for the next look.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from dataclasses import replace

from smbus2 import i2c_msg

from lodeline.devices.link import Health
from lodeline.devices.mpu import INT_PIN_CFG, USER_CTRL, ImuReading, Mpu
from lodeline.devices.mpu_models import MpuParams
from lodeline.devices.sample_clock import SampleClock
from lodeline.i2c import Bus

FIFO_COUNT_H = 0x72
FIFO_R_W = 0x74
EVERYTHING = 0xF8  # accelerometer, thermometer and gyro, in the order of the data registers
FIFO_ON, FIFO_RESET = 0x40, 0x04
OVERFLOW = 0x10
FRAME = 14  # bytes
FULLEST = 0.5  # part of the FIFO that one look may find, so that a late look loses nothing
SURE, KNOWN = 0.15, 0.2  # periods: off by so much, times are not looked into, and good enough
HUNT = 1.2  # periods for which the counter is watched,
LONGEST_HUNT = 0.006  # s, at most
PATIENCE = 0.5  # s, after which samples go out although their times are less well known
NOT_READ = (errno.EREMOTEIO, errno.ENXIO)  # not acknowledged: then nothing was read either


def check_rate(params: MpuParams, rate: float) -> None:
    """Raise ValueError if the chip cannot well be looked at `rate` times a second [Hz]."""
    sampled = params.sample_rate
    if rate > sampled:
        raise ValueError(f"rate must not be above the sample_rate of {sampled:g} Hz, got {rate:g}")
    needed = sampled * FRAME / (FULLEST * 512)
    if params.fifo and rate < needed:
        raise ValueError(f"a FIFO at {sampled:g} Hz needs a rate of {needed:.0f} Hz or more")


class MpuFifo(Mpu):
    """The driver with a FIFO. `clock` [s] tells how late a look is within its tick."""

    fifo_parts = EVERYTHING
    user_control = FIFO_ON

    def __init__(
        self, bus: Bus, params: MpuParams, clock: Callable[[], float], name: str = "imu"
    ) -> None:
        super().__init__(bus, params, name)
        self._clock = clock
        self._samples = SampleClock(1.0 / params.sample_rate)
        self._waiting = 0  # samples that were counted, and could not be read
        self._last_s = 0.0
        self._vague_s = float("inf")  # since when times are not known well enough
        self._vague = False
        self._torn = False
        self.lost = 0

    @property
    def health(self) -> Health:
        """How the chip does: less well while nobody knows exactly when its samples were taken."""
        health = self.link.health
        if not self._vague or health.state != "ok":
            return health
        text = f"FIFO_TIMES {self.name}: times are off by up to {self._off(1):.1f} samples"
        return replace(health, state="degraded", message=f"{text} - use a faster bus")

    def read_all(self, now_s: float) -> list[tuple[float, ImuReading]]:
        """Return all samples taken since the last look: (time [s] by the clock of `now_s`, sample).

        `now_s` is now, at the beginning of the tick.
        """
        ahead_s = now_s - self._clock()
        if not self.ready(now_s):
            return []
        there = self._look(now_s, ahead_s)
        if there == 0:
            self.guard.nothing(now_s)
        if not there or self._waits(now_s, there):
            return []
        samples = []
        known = (float("inf") if self._vague else KNOWN) * self._samples.period
        for place, frame in enumerate(self._frames(now_s, there)):
            t, off = self._samples.taken(there - 1 - place)
            if off > known:
                self.lost += 1
                continue
            t = self._last_s = max(t, self._last_s + 1e-6)  # where times had to be found anew
            if self.guard.passes(t, frame):
                samples.append((t, self.decode(frame)))
        return samples

    def _look(self, now_s: float, ahead_s: float) -> int | None:
        """Count the samples in the FIFO, until it is known when they were taken."""
        begun = self._clock()
        ends = begun + min(HUNT * self._samples.period, LONGEST_HUNT)
        while True:
            before = self._clock()
            counted = self.link.attempt(now_s, self._count)
            after = self._clock()
            if counted is None:
                return None
            if counted > self.model.fifo_size - FRAME:
                self._drop(now_s, "FIFO_OVERFLOW", "read too late")
                return None
            there = counted // FRAME
            self._samples.update(before + ahead_s, after + ahead_s, there - self._waiting)
            self._waiting = there
            # a clock that stands still is simulated: watching would last for ever
            if self._off(there) <= SURE or after >= ends or after == begun:
                return there

    def _off(self, there: int) -> float:
        """How far off the times of so many samples may be [periods]."""
        oldest, newest = self._samples.taken(max(there - 1, 0)), self._samples.taken()
        return max(oldest[1], newest[1]) / self._samples.period

    def _waits(self, now_s: float, there: int) -> bool:
        """Tell whether samples stay in the FIFO, because a later look will tell of them too."""
        self.guard.alive(now_s)
        if self._off(there) <= KNOWN:
            self._vague_s, self._vague = float("inf"), False
            return False
        self._vague_s = min(self._vague_s, now_s)
        self._vague = now_s - self._vague_s > PATIENCE
        return not self._vague and there * FRAME <= FULLEST * self.model.fifo_size

    def _frames(self, now_s: float, there: int) -> list[bytes]:
        """Take the frames out, and look whether the chip is still the one that was set up."""
        data = self.link.attempt(now_s, lambda: self._pop(there * FRAME))
        if data is None:
            if self._torn:
                self._drop(now_s, "FIFO_TORN", "failed half-way")
            return []
        self._waiting = 0
        state = self.link.attempt(now_s, self._state)
        if state is None or self.forgot(now_s, state[0]):
            self._samples.restart()
            self.lost += there
            return []
        if state[3] & OVERFLOW:
            self._drop(now_s, "FIFO_OVERFLOW", "read too late")
            return []
        return [data[at : at + FRAME] for at in range(0, len(data), FRAME)]

    def _drop(self, now_s: float, code: str, why: str) -> None:
        """Empty the FIFO, whose frames cannot be told apart or counted any more."""
        lost = round((now_s - self._last_s) / self._samples.period) if self._last_s else 0
        self.lost += lost
        self.link.health.tell(f"{code} {self.name}: {why}, {lost} samples lost")
        self.link.attempt(now_s, self._start)

    def _count(self) -> int:
        high, low = self.bus.read_i2c_block_data(self.params.address, FIFO_COUNT_H, 2)
        return high << 8 | low

    def _pop(self, length: int) -> bytes:
        if self._torn:  # trying again would read frames out of step
            raise OSError(errno.EIO, "FIFO read failed half-way")
        got = i2c_msg.read(self.params.address, length)
        try:
            self.bus.i2c_rdwr(i2c_msg.write(self.params.address, [FIFO_R_W]), got)
        except OSError as error:
            self._torn = error.errno not in NOT_READ
            raise
        return bytes(iter(got))

    def _state(self) -> list[int]:
        return self.bus.read_i2c_block_data(self.params.address, INT_PIN_CFG, 4)

    def _start(self) -> float:
        bus, address = self.bus, self.params.address
        bus.write_byte_data(address, USER_CTRL, FIFO_RESET)  # the older ones do it while off only
        bus.write_byte_data(address, USER_CTRL, FIFO_ON)
        self._state()  # clears an overflow of before
        self._samples.restart()
        self._waiting = 0
        self._torn = False
        return 0.0
