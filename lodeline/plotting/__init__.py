"""Plots of recordings, to hand in or to look into: PNG files, or one page that needs no network.

`run` reads a recording, `kinds` says what of it becomes a plot, `figure` is what a plot is made of,
`png` and `page` draw it. `comparison` lays two runs over each other.
"""


class NothingToPlotError(Exception):
    """A recording lacks what a plot needs, or two have nothing in common; the text says what."""


class NoMatplotlibError(Exception):
    """matplotlib is not installed; the text says how to get it."""
