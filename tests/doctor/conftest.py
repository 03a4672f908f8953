"""The doctor's patients are the rigs of the driver tests."""

from __future__ import annotations

from tests.devices.conftest import rig

__all__ = ["rig"]
