"""Messages that command the robot."""

from typing import Annotated

from lodeline_msgs.definition import Message, Unit, message


@message
class Twist(Message):
    """Wanted body velocity, the two parts of geometry_msgs/Twist that wheels can do."""

    v: Annotated[float, Unit("m/s", "forward")]
    w: Annotated[float, Unit("rad/s", "counter-clockwise")]
