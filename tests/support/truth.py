"""What the truth was at times between those at which it was told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lodeline.rotation import wrap_angle, yaw_of
from lodeline_msgs import AttitudeEstimate, Message, Odometry


def heading_errors(attitudes: Sequence[Message], truth: Sequence[Message]) -> list[float]:
    """Headings less the true ones of the same moment [rad], where the truth was told around it."""
    told = [m for m in truth if isinstance(m, Odometry)]
    begin = told[0].stamp
    since = [m.stamp - begin for m in told]
    yaws = np.unwrap([m.yaw for m in told])
    return [
        wrap_angle(yaw_of(m.orientation) - float(np.interp(m.stamp - begin, since, yaws)))
        for m in attitudes
        if isinstance(m, AttitudeEstimate) and begin <= m.stamp <= told[-1].stamp
    ]
