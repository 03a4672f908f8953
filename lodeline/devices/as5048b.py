"""Two AS5048B magnetic encoders, one per wheel: angles in, cumulative counts out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from lodeline.devices.counter import Counter
from lodeline.devices.link import Health, Link
from lodeline.i2c import Bus

DIAGNOSTICS = 0xFB  # magnitude and angle, two bytes each, follow
OFFSETS_LOADED = 0x01
CORDIC_OVERFLOW = 0x02
FIELD_STRONG = 0x04  # the magnet is too near
FIELD_WEAK = 0x08  # the magnet is too far


@dataclass(frozen=True, slots=True)
class EncodersParams:
    """Where the encoders are. An inverted one counts down when its wheel rolls forward.

    `max_speed` is that of the shaft, in turns a second: what turns faster is no wheel but a fault.
    """

    left_address: Annotated[int, "1"] = 0x40
    right_address: Annotated[int, "1"] = 0x41
    left_inverted: Annotated[bool, "1"] = False
    right_inverted: Annotated[bool, "1"] = False
    max_speed: Annotated[float, "1/s"] = 20.0

    def __post_init__(self) -> None:
        if not self.max_speed > 0.0:
            raise ValueError(f"max_speed must be positive, not {self.max_speed} turns/s")


@dataclass(frozen=True, slots=True)
class EncodersState:
    """Where two counters stood, so that a successor counts on: counts, angles, counts/s, s."""

    now_s: float
    counts: tuple[int, int]
    angles: tuple[int, int]
    speeds: tuple[float, float]


class _Encoder:
    """One encoder with its link."""

    def __init__(self, name: str, bus: Bus, address: int, inverted: bool, max_speed: float) -> None:
        self._name = name
        self._bus = bus
        self._address = address
        self._sign = -1 if inverted else 1
        self.counter = Counter(max_speed)
        self._trouble = 0
        self.link = Link(name, bus, address, (self._answer,))

    def read(self, now_s: float) -> bool | None:
        """Update the counter: None if there is no angle, False if it had to start anew."""
        link = self.link
        if not link.ready(now_s):
            return None
        raw = link.attempt(now_s, self._burst)
        if raw is None or not self._is_valid(raw[0]):
            return None
        known = self.counter.update(now_s, (raw[3] << 6) | (raw[4] & 0x3F))
        if self.counter.refused:
            if self.counter.refused == 1:
                link.health.tell(f"ENC_JUMP {self._name}: too large a step, reading dropped")
            return None
        if not known:
            link.health.tell(f"ENC_GAP {self._name}: {self.counter.why}, counts from 0")
        return None if self.counter.waiting else known

    @property
    def count(self) -> int:
        return self._sign * self.counter.count

    def _is_valid(self, flags: int) -> bool:
        """Tell by the flags read with an angle whether it counts, and how the magnet sits."""
        trouble = flags & (CORDIC_OVERFLOW | FIELD_STRONG | FIELD_WEAK) | ~flags & OFFSETS_LOADED
        if trouble != self._trouble:
            health = self.link.health
            text = TROUBLES[trouble] if trouble else "magnet sits well again"
            health.tell(f"ENC_MAGNET {self._name}: {text}")
            invalid = trouble & (CORDIC_OVERFLOW | OFFSETS_LOADED)
            health.state = "fault" if invalid else "degraded" if trouble else "ok"
        self._trouble = trouble
        return not trouble & (CORDIC_OVERFLOW | OFFSETS_LOADED)

    def _answer(self) -> float:
        flags = self._bus.read_byte_data(self._address, DIAGNOSTICS)
        return 0.0 if flags & OFFSETS_LOADED else 0.01

    def _burst(self) -> list[int]:
        # the angle comes with its own diagnosis: so a false one is known as such
        return self._bus.read_i2c_block_data(self._address, DIAGNOSTICS, 5)


TROUBLES = {
    trouble: " and ".join(
        text
        for bit, text in (
            (OFFSETS_LOADED, "just switched on"),
            (CORDIC_OVERFLOW, "angle not valid"),
            (FIELD_STRONG, "magnet too near"),
            (FIELD_WEAK, "magnet too far"),
        )
        if trouble & bit
    )
    for trouble in range(1, 16)
}


class Encoders:
    """The driver of both wheels. A lost reading drops the sample; the next one is right again.

    After a silence of over 1 s, or one in which a wheel changed its speed so much that a whole
    turn may hide in it, both counts start from 0 again, for nobody knows how often the wheels went
    round: odometry takes that as a new reference, not as way.
    """

    def __init__(
        self, bus: Bus, params: EncodersParams | None = None, name: str = "encoders"
    ) -> None:
        p = params if params is not None else EncodersParams()
        self._left = _Encoder(f"{name} left", bus, p.left_address, p.left_inverted, p.max_speed)
        self._right = _Encoder(f"{name} right", bus, p.right_address, p.right_inverted, p.max_speed)

    @property
    def health(self) -> Health:
        """How the worse of the two does, with the counts of both."""
        left, right = self._left.link.health, self._right.link.health
        order = ("ok", "degraded", "fault")
        worse = max(left, right, key=lambda each: (order.index(each.state), each.events))
        return Health(
            state=worse.state,
            message=worse.message,
            events=left.events + right.events,
            retried=left.retried + right.retried,
            failed=left.failed + right.failed,
            recovered=left.recovered + right.recovered,
        )

    def read(self, now_s: float) -> tuple[int, int] | None:
        """Return the cumulative counts (left, right), forward positive, 16384 to a turn."""
        left = self._left.read(now_s)
        right = self._right.read(now_s)
        if left is False or right is False:
            self._left.counter.restart()
            self._right.counter.restart()
        return None if left is None or right is None else (self._left.count, self._right.count)

    @property
    def state(self) -> EncodersState | None:
        """Where the counters stand; None until both were read."""
        now_s, left, left_angle, left_speed = self._left.counter.reading
        _, right, right_angle, right_speed = self._right.counter.reading
        if min(left_angle, right_angle) < 0:
            return None
        return EncodersState(
            now_s, (left, right), (left_angle, right_angle), (left_speed, right_speed)
        )

    def resume(self, state: EncodersState) -> None:
        """Count on from a predecessor's state: its silence is bridged like that of the bus."""
        for place, encoder in enumerate((self._left, self._right)):
            encoder.counter.resume(
                state.now_s, state.counts[place], state.angles[place], state.speeds[place]
            )
