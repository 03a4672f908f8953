"""How unsure a heading becomes with time, and over holes in the samples."""

from math import pi, sqrt

# Standard deviation of a heading about which nothing is known: uniform over the circle.
UNKNOWN_HEADING = pi / sqrt(3.0)
NO_IDEA = UNKNOWN_HEADING * UNKNOWN_HEADING  # its variance [rad^2]
# Samples further apart than this [s] leave a hole, in which a body may turn at about this [rad/s].
HOLE = 0.25
UNSEEN_RATE = 0.6


def aged_variance(variance: float, dt: float, drift: float) -> float:
    """Heading variance [rad^2] after `dt` [s] in which the heading may drift at `drift` [rad/s].

    The drift is a constant rate of unknown sign, so the deviation grows in proportion to time.
    Over a hole in the samples the body may have turned unseen.
    """
    std = sqrt(variance) + drift * dt
    return min(std * std + hole_variance(dt), NO_IDEA)


def hole_variance(dt: float) -> float:
    """Variance [rad^2] of the turn between two samples `dt` [s] apart that neither of them saw."""
    return (UNSEEN_RATE * dt) ** 2 if dt > HOLE else 0.0
