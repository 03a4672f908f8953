"""Magnets in the floor and the reed bar that sees them."""

from lodeline.magnets.lattice import Lattice
from lodeline.magnets.reed_bar import ReedBar, ReedBarParams

__all__ = ["Lattice", "ReedBar", "ReedBarParams"]
