"""What a driver does while something is wrong: lets nothing false out, says so, comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from tests.devices.rig import Rig

T = TypeVar("T")


class Health(Protocol):
    """What a driver tells of its device."""

    @property
    def state(self) -> str: ...
    @property
    def message(self) -> str: ...


@dataclass
class Outcome(Generic[T]):
    """The figures of one fault: times in seconds, samples counted from the fault's beginning on.

    `noticed` counts from the beginning until the state or message changes, `recovered` from the
    end until the first sample.
    """

    rate: float
    false: int = 0
    sent: int = 0
    lost: int = 0
    noticed: float = float("inf")
    recovered: float = float("inf")
    states: set[str] = field(default_factory=set)
    messages: list[str] = field(default_factory=list)
    after: str = ""

    def __str__(self) -> str:
        return (
            f"sent meanwhile {self.sent} of which false {self.false}, lost {self.lost}, "
            f"noticed {self.noticed:.3f} s, recovered {self.recovered:.3f} s, "
            f"{'/'.join(sorted(self.states))}: {self.messages[0] if self.messages else '-'}"
        )


def suffer(
    bench: Rig,
    rate: float,
    read: Callable[[float], T | None],
    health: Callable[[], Health],
    true: Callable[[float, T], bool],
    begin: Callable[[], object],
    end: Callable[[], object],
    lasts: float = 1.0,
) -> Outcome[T]:
    """Run healthy for 2 s, with the fault for `lasts` seconds, and for 3 s after it."""
    out: Outcome[T] = Outcome(rate)
    bench.run(2.0, rate, read)
    before = (health().state, health().message)
    assert before[0] == "ok", before

    back: float | None = None

    def look(now: float) -> None:
        got = read(now)
        state = (health().state, health().message)
        if state != before and out.noticed == float("inf"):
            out.noticed = now - at
        if state != before and state[1] not in out.messages:
            out.messages.append(state[1])
        out.lost += got is None
        out.false += got is not None and not true(now, got)
        if back is None:
            out.states.add(state[0])
            out.sent += got is not None
        elif got is not None and out.recovered == float("inf"):
            out.recovered = now - back

    at = bench.now
    begin()
    bench.run(lasts, rate, look)
    back = bench.now
    end()
    bench.run(3.0, rate, look)
    out.after = health().state
    return out
