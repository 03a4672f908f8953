"""The plainest watch over a magnetic field: is it as strong as it usually is?"""

from dataclasses import dataclass

from lodeline.attitude.base import Attitude, AttitudeState

DISTURBANCE = 0.15  # relative deviation that is no longer noise or tilt


@dataclass(slots=True)
class StrengthState(AttitudeState):
    """What is usual here, and what the last sample had."""

    usual: float = 0.0  # [T], 0 before the first field
    strength: float = 0.0  # [T]


class StrengthWatcher(Attitude):
    """A method that calls a field disturbed by its strength alone."""

    _state: StrengthState

    @property
    def disturbed(self) -> bool:
        """True while the field is more than 15 % off its usual strength."""
        s = self._state
        return abs(s.strength - s.usual) > DISTURBANCE * s.usual
