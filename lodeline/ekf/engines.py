"""The two engines by name: `scalar` is the one to use, `filterpy` the one to compare it with."""

from lodeline.ekf.engine import Engine, EngineName
from lodeline.ekf.scalar_engine import ScalarEngine


def make_engine(name: EngineName) -> Engine:
    """The engine of that name; filterpy (and numpy, scipy) is imported only when asked for."""
    if name == "filterpy":
        from lodeline.ekf.filterpy_engine import FilterpyEngine

        return FilterpyEngine()
    return ScalarEngine()
