"""Whether the measurements still fit: what the gate refused lately, and the alarms it led to."""

from typing import NamedTuple

from lodeline.ekf.belief import made

RECENT = 8  # sights of which too many must not be refused


class Trust(NamedTuple):
    """`nis` of the last measurement, the number refused so far, and how it went lately."""

    nis: float = 0.0
    rejected: int = 0
    recent: int = 0  # one bit for each of the last sights of magnets, newest lowest: 1 was refused
    streak: int = 0  # landmarks in a row that fitted; negative, that did not
    alarms: int = 0  # times that the robot was lost or moved

    def after_sight(self, nis: float, *, rejected: bool) -> "Trust":
        """One sight of a magnet more; one that fits after none was refused is nothing new."""
        if not rejected and not self.recent:
            _, refused, _, streak, alarms = self
            return made(Trust, (nis, refused, 0, streak, alarms))
        recent = (self.recent << 1 | rejected) & ((1 << RECENT) - 1)
        return self._replace(nis=nis, rejected=self.rejected + rejected, recent=recent)

    def after_landmark(self, nis: float, *, rejected: bool) -> "Trust":
        """One landmark more. They are no lattice: enough of them end every alarm."""
        if rejected:
            streak = min(self.streak, 0) - 1
            return self._replace(nis=nis, rejected=self.rejected + 1, streak=streak)
        streak = max(self.streak, 0) + 1
        return self._replace(nis=nis, streak=streak, alarms=0 if streak >= RECENT else self.alarms)

    @property
    def refusals(self) -> int:
        """How many of the last `RECENT` sights of magnets were refused."""
        return self.recent.bit_count()

    def alarmed(self) -> "Trust":
        """The robot is not where it was thought to be: begin to count anew."""
        return self._replace(recent=0, alarms=self.alarms + 1)
