"""Messages that estimators send, and the simulator's truth in the same words."""

from typing import Annotated

from lodeline_msgs.definition import Message, Unit, message
from lodeline_msgs.sensors import XYZ, Vector3

Quaternion = tuple[float, float, float, float]
Matrix2 = tuple[float, float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]

POSE_PARTS = ("xx", "xy", "xyaw", "yx", "yy", "yyaw", "yawx", "yawy", "yawyaw")
TWIST_PARTS = ("vv", "vw", "wv", "ww")


@message
class AttitudeEstimate(Message):
    """Orientation of the body in the world (ENU), with what the filter learned."""

    orientation: Annotated[Quaternion, Unit("1", "quaternion, body to world", ("x", "y", "z", "w"))]
    angular_velocity: Annotated[Vector3, Unit("rad/s", "body rates less the bias", XYZ)]
    gyro_bias: Annotated[Vector3, Unit("rad/s", "estimated zero offset of the gyro", XYZ)]
    heading_std: Annotated[float, Unit("rad", "one sigma of the heading")]
    disturbed: Annotated[bool, Unit("", "the magnetic field is not the one learned")]


@message
class Odometry(Message):
    """Pose in a frame that drifts but never jumps, and body twist, as nav_msgs/Odometry."""

    x: Annotated[float, Unit("m", "east of the start")]
    y: Annotated[float, Unit("m", "north of the start")]
    yaw: Annotated[float, Unit("rad", "from east, counter-clockwise positive")]
    v: Annotated[float, Unit("m/s", "forward speed, mean over the interval")]
    w: Annotated[float, Unit("rad/s", "yaw rate, mean over the interval")]
    pose_covariance: Annotated[
        Matrix3, Unit("m^2, m rad, rad^2", "of x, y, yaw, row by row", POSE_PARTS)
    ]
    twist_covariance: Annotated[
        Matrix2, Unit("(m/s)^2, m rad/s^2, (rad/s)^2", "K Qq K^T of v, w", TWIST_PARTS)
    ]
    interval: Annotated[float, Unit("s", "time over which the twist is a mean")]
    resets: Annotated[int, Unit("1", "rises when the pose jumped: do not take a difference")] = 0


@message
class PoseEstimate(Message):
    """Pose of base_link in the map, with an honest covariance."""

    x: Annotated[float, Unit("m", "east in the map")]
    y: Annotated[float, Unit("m", "north in the map")]
    yaw: Annotated[float, Unit("rad", "from east, counter-clockwise positive")]
    covariance: Annotated[
        Matrix3, Unit("m^2, m rad, rad^2", "of x, y, yaw, row by row", POSE_PARTS)
    ]
    nis: Annotated[float, Unit("1", "normalised innovation squared of the last measurement")]
    rejected: Annotated[int, Unit("1", "measurements refused by the gate so far")]
    ambiguous: Annotated[bool, Unit("", "too uncertain to tell one magnet from the next")]
