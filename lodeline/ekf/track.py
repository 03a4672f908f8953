"""All that is believed and remembered at one moment: a part for each that writes it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from lodeline.ekf.belief import Belief
from lodeline.ekf.lift import Lift
from lodeline.ekf.mixture import Hypothesis, Mixture
from lodeline.ekf.motion import Pace
from lodeline.ekf.reeds import BarMemory
from lodeline.ekf.trust import Trust
from lodeline.ekf.turning import Turning


@dataclass(frozen=True, slots=True)
class Track:
    """Carried from sample to sample, and what a restart needs; a step makes a new one.

    `mixture` has one hypothesis while it is clear which magnets were met, the likeliest first
    while it is not. `compass_ns` is when a heading was used last (None: never).
    `wide` remembers that the pose was in doubt: that ends at a lower level than it begins.
    """

    mixture: Mixture
    pace: Pace = field(default_factory=Pace)
    turning: Turning = field(default_factory=Turning)
    bar: BarMemory = field(default_factory=BarMemory)
    lift: Lift = field(default_factory=Lift)
    trust: Trust = field(default_factory=Trust)
    compass_ns: int | None = None
    wide: bool = False

    @property
    def belief(self) -> Belief:
        """That of the likeliest hypothesis."""
        return self.mixture[0].belief

    @property
    def torn(self) -> bool:
        """True while it is not clear which magnets were met."""
        return len(self.mixture) > 1

    def moved(
        self, change: Callable[[Belief], Belief], pace: Pace, turning: Turning, bar: BarMemory
    ) -> "Track":
        """After a motion: the same change to every hypothesis, and what moved along with it."""
        mixture = tuple([Hypothesis(w, change(belief)) for w, belief in self.mixture])
        return Track(mixture, pace, turning, bar, self.lift, self.trust, self.compass_ns, self.wide)

    def each(self, change: Callable[[Belief], Belief]) -> "Track":
        """The same change to every hypothesis."""
        mixture = tuple([Hypothesis(w, change(belief)) for w, belief in self.mixture])
        return replace(self, mixture=mixture)

    def widened(self, position: float, heading: float) -> "Track":
        """Every hypothesis less sure by these standard deviations [m, rad]."""
        return self.each(lambda belief: belief.widened(position, heading))

    def alarmed(self, position: float, heading: float) -> "Track":
        """It was moved or is lost: less sure, and which magnets it met is open again."""
        bar = replace(self.bar, contacts=())
        return replace(self.widened(position, heading), bar=bar, trust=self.trust.alarmed())
