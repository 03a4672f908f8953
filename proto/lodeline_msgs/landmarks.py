"""Messages about known places: landmarks that were seen, and positions that were measured."""

from __future__ import annotations

from typing import Annotated

from lodeline_msgs.definition import Message, Unit, message

Floats = tuple[float, ...]


@message
class LandmarkDetection(Message):
    """Landmarks of the map, seen from base_link at one moment: part i of each array is of mark i.

    `range` or `bearing` is empty where it is not measured, and its deviation with it.
    """

    x: Annotated[Floats, Unit("m", "east in the map of each landmark")]
    y: Annotated[Floats, Unit("m", "north in the map of each landmark")]
    range: Annotated[Floats, Unit("m", "distance of each landmark, or empty")]
    range_std: Annotated[Floats, Unit("m", "one sigma of each range")]
    bearing: Annotated[Floats, Unit("rad", "of each landmark, from ahead to the left, or empty")]
    bearing_std: Annotated[Floats, Unit("rad", "one sigma of each bearing")]


@message
class PositionFix(Message):
    """Position of base_link in the map, measured as a whole: by radio, camera or satellite."""

    x: Annotated[float, Unit("m", "east in the map")]
    y: Annotated[float, Unit("m", "north in the map")]
    std: Annotated[float, Unit("m", "one sigma, along each axis")]
