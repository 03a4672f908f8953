"""All that is believed and remembered at one moment: a part for each that writes it."""

from collections.abc import Callable
from typing import NamedTuple

from lodeline.ekf.agreement import Agreement
from lodeline.ekf.belief import Belief, made
from lodeline.ekf.learned import Learned
from lodeline.ekf.lift import LEVEL, Lift
from lodeline.ekf.mixture import Hypothesis, Mixture
from lodeline.ekf.motion import Pace
from lodeline.ekf.reeds import BarMemory
from lodeline.ekf.trust import Trust


class Track(NamedTuple):
    """Carried from sample to sample, and what a restart needs; a step makes a new one.

    `mixture` has one hypothesis while it is clear which magnets were met, the likeliest first
    while it is not. `compass_ns` is when a heading was used last (None: never).
    `wide` remembers that the pose was in doubt: that ends at a lower level than it begins.
    `learned` are constants of the robot, if any are to be learned.
    """

    mixture: Mixture
    pace: Pace = Pace()
    agreement: Agreement = Agreement()
    bar: BarMemory = BarMemory()
    lift: Lift = LEVEL
    trust: Trust = Trust()
    compass_ns: int | None = None
    wide: bool = False
    learned: Learned | None = None

    @property
    def belief(self) -> Belief:
        """That of the likeliest hypothesis."""
        return self.mixture[0].belief

    @property
    def torn(self) -> bool:
        """True while it is not clear which magnets were met."""
        return len(self.mixture) > 1

    def read(self, bar: BarMemory) -> "Track":
        """After a reading of the bar that changed nothing but the memory of it."""
        mixture, pace, agreement, _, lift, trust, compass_ns, wide, learned = self
        return made(Track, (mixture, pace, agreement, bar, lift, trust, compass_ns, wide, learned))

    def each(self, change: Callable[[Belief], Belief]) -> "Track":
        """The same change to every hypothesis."""
        mixture = tuple([Hypothesis(w, change(belief)) for w, belief in self.mixture])
        return self._replace(mixture=mixture)

    def widened(self, position: float, heading: float) -> "Track":
        """Every hypothesis less sure by these standard deviations [m, rad]."""
        return self.each(lambda belief: belief.widened(position, heading))

    def alarmed(self, position: float, heading: float) -> "Track":
        """It was moved or is lost: less sure, and which magnets it met is open again."""
        bar = self.bar._replace(contacts=())
        return self.widened(position, heading)._replace(bar=bar, trust=self.trust.alarmed())
