"""Messages that sensors send, and their calibrated forms."""

from typing import Annotated

from lodeline_msgs.definition import Message, Unit, message

Vector3 = tuple[float, float, float]
XYZ = ("x", "y", "z")


@message
class Imu(Message):
    """Gyro and accelerometer, as sensor_msgs/Imu without the orientation."""

    angular_velocity: Annotated[Vector3, Unit("rad/s", "about the body axes, FLU", XYZ)]
    linear_acceleration: Annotated[
        Vector3, Unit("m/s^2", "specific force in the body axes: +9.81 on z at rest", XYZ)
    ]


@message
class MagneticField(Message):
    """Magnetometer, as sensor_msgs/MagneticField."""

    magnetic_field: Annotated[Vector3, Unit("T", "in the body axes, FLU", XYZ)]


@message
class WheelTicks(Message):
    """Encoder counts of a two-wheeled robot since the driver started."""

    left: Annotated[int, Unit("tick", "cumulative count of the left encoder")]
    right: Annotated[int, Unit("tick", "cumulative count of the right encoder")]


@message
class ReedBar(Message):
    """State of the reed switches over the floor magnets."""

    closed: Annotated[int, Unit("bits", "bit n is set while reed n + 1 is closed; reed 8 is left")]


@message
class MagnetDetection(Message):
    """Magnets under the reed bar, one number for each group of closed reeds."""

    lateral: Annotated[
        tuple[float, ...], Unit("m", "offset of each magnet along the bar, left is positive")
    ]
