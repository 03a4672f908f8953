"""The messages of Lodeline: one definition each, and everything that follows from it."""

from lodeline_msgs.codec import (
    ENCODING,
    DecodeError,
    class_of,
    encoding_of,
    pack,
    packer_of,
    unpack,
    unpack_map,
    unpacker_of,
)
from lodeline_msgs.control import Twist
from lodeline_msgs.definition import MESSAGES, FieldSpec, Message, Unit, field_specs, message
from lodeline_msgs.described import class_described
from lodeline_msgs.estimates import AttitudeEstimate, Odometry, PoseEstimate
from lodeline_msgs.landmarks import LandmarkDetection, PositionFix
from lodeline_msgs.schema import columns, from_row, json_schema, row, stamp_text, unit_table
from lodeline_msgs.sensors import Imu, MagnetDetection, MagneticField, ReedBar, WheelTicks
from lodeline_msgs.status import NodeStatus

__all__ = [
    "ENCODING",
    "MESSAGES",
    "AttitudeEstimate",
    "DecodeError",
    "FieldSpec",
    "Imu",
    "LandmarkDetection",
    "MagnetDetection",
    "MagneticField",
    "Message",
    "NodeStatus",
    "Odometry",
    "PoseEstimate",
    "PositionFix",
    "ReedBar",
    "Twist",
    "Unit",
    "WheelTicks",
    "class_described",
    "class_of",
    "columns",
    "encoding_of",
    "field_specs",
    "from_row",
    "json_schema",
    "message",
    "pack",
    "packer_of",
    "row",
    "stamp_text",
    "unit_table",
    "unpack",
    "unpack_map",
    "unpacker_of",
]
