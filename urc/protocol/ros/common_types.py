"""The types that drivers publish most often, from the ROS common interfaces.

A robot sends definitions of the types that it publishes, but not of the types that it only
receives. Messages of other types are sent as JSON (`urc.protocol.ros.topic_codec`).

Sources: common_interfaces, rcl_interfaces, unique_identifier_msgs and common_msgs, from ROS 2 Jazzy
and ROS 1 Noetic; control_msgs 6.8.0.
"""

from collections.abc import Mapping
from functools import cache
from typing import Final

from urc.protocol.ros.definition import Definition, Definitions, MessageField
from urc.protocol.ros.msg_text import parse_lines

__all__ = ["common_types"]

_TYPES: Final = """\
std_msgs/Header: builtin_interfaces/Time stamp, string frame_id
std_msgs/Bool: bool data
std_msgs/Byte: byte data
std_msgs/Char: char data
std_msgs/String: string data
std_msgs/Empty:
std_msgs/ColorRGBA: float32 r, float32 g, float32 b, float32 a
std_msgs/Float32: float32 data
std_msgs/Float64: float64 data
std_msgs/Int8: int8 data
std_msgs/Int16: int16 data
std_msgs/Int32: int32 data
std_msgs/Int64: int64 data
std_msgs/UInt8: uint8 data
std_msgs/UInt16: uint16 data
std_msgs/UInt32: uint32 data
std_msgs/UInt64: uint64 data
std_msgs/MultiArrayDimension: string label, uint32 size, uint32 stride
std_msgs/MultiArrayLayout: MultiArrayDimension[] dim, uint32 data_offset
std_msgs/Float32MultiArray: MultiArrayLayout layout, float32[] data
std_msgs/Float64MultiArray: MultiArrayLayout layout, float64[] data
std_msgs/Int32MultiArray: MultiArrayLayout layout, int32[] data
geometry_msgs/Vector3: float64 x, float64 y, float64 z
geometry_msgs/Vector3Stamped: Header header, Vector3 vector
geometry_msgs/Point: float64 x, float64 y, float64 z
geometry_msgs/Point32: float32 x, float32 y, float32 z
geometry_msgs/PointStamped: Header header, Point point
geometry_msgs/Quaternion: float64 x, float64 y, float64 z, float64 w 1
geometry_msgs/QuaternionStamped: Header header, Quaternion quaternion
geometry_msgs/Pose: Point position, Quaternion orientation
geometry_msgs/Pose2D: float64 x, float64 y, float64 theta
geometry_msgs/PoseStamped: Header header, Pose pose
geometry_msgs/PoseArray: Header header, Pose[] poses
geometry_msgs/PoseWithCovariance: Pose pose, float64[36] covariance
geometry_msgs/PoseWithCovarianceStamped: Header header, PoseWithCovariance pose
geometry_msgs/Polygon: Point32[] points
geometry_msgs/PolygonStamped: Header header, Polygon polygon
geometry_msgs/Twist: Vector3 linear, Vector3 angular
geometry_msgs/TwistStamped: Header header, Twist twist
geometry_msgs/TwistWithCovariance: Twist twist, float64[36] covariance
geometry_msgs/TwistWithCovarianceStamped: Header header, TwistWithCovariance twist
geometry_msgs/Accel: Vector3 linear, Vector3 angular
geometry_msgs/AccelStamped: Header header, Accel accel
geometry_msgs/AccelWithCovariance: Accel accel, float64[36] covariance
geometry_msgs/AccelWithCovarianceStamped: Header header, AccelWithCovariance accel
geometry_msgs/Inertia: float64 m, Vector3 com, float64 ixx, float64 ixy, float64 ixz,
  float64 iyy, float64 iyz, float64 izz
geometry_msgs/InertiaStamped: Header header, Inertia inertia
geometry_msgs/Transform: Vector3 translation, Quaternion rotation
geometry_msgs/TransformStamped: Header header, string child_frame_id, Transform transform
geometry_msgs/Wrench: Vector3 force, Vector3 torque
geometry_msgs/WrenchStamped: Header header, Wrench wrench
nav_msgs/Odometry: Header header, string child_frame_id, geometry_msgs/PoseWithCovariance pose,
  geometry_msgs/TwistWithCovariance twist
nav_msgs/Path: Header header, geometry_msgs/PoseStamped[] poses
sensor_msgs/Joy: Header header, float32[] axes, int32[] buttons
sensor_msgs/JoyFeedback: uint8 type, uint8 id, float32 intensity
sensor_msgs/JoyFeedbackArray: JoyFeedback[] array
sensor_msgs/JointState: Header header, string[] name, float64[] position, float64[] velocity,
  float64[] effort
sensor_msgs/NavSatFix: Header header, NavSatStatus status, float64 latitude, float64 longitude,
  float64 altitude, float64[9] position_covariance, uint8 position_covariance_type
sensor_msgs/NavSatStatus: int8 status, uint16 service
sensor_msgs/CompressedImage: Header header, string format, uint8[] data
sensor_msgs/RegionOfInterest: uint32 x_offset, uint32 y_offset, uint32 height, uint32 width,
  bool do_rectify
trajectory_msgs/JointTrajectory: Header header, string[] joint_names,
  JointTrajectoryPoint[] points
trajectory_msgs/JointTrajectoryPoint: float64[] positions, float64[] velocities,
  float64[] accelerations, float64[] effort, builtin_interfaces/Duration time_from_start
control_msgs/JointJog: Header header, string[] joint_names, float64[] displacements,
  float64[] velocities, float64 duration
action_msgs/GoalInfo: unique_identifier_msgs/UUID goal_id, builtin_interfaces/Time stamp
unique_identifier_msgs/UUID: uint8[16] uuid
actionlib_msgs/GoalID: builtin_interfaces/Time stamp, string id
"""
_ROS1: Final[Mapping[str, tuple[MessageField, ...]]] = {
    "std_msgs/Header": (
        MessageField("seq", "uint32"),
        MessageField("stamp", "time"),
        MessageField("frame_id", "string"),
    ),
    "actionlib_msgs/GoalID": (MessageField("stamp", "time"), MessageField("id", "string")),
    "trajectory_msgs/JointTrajectoryPoint": (
        *(MessageField(name, "float64", 0) for name in ("positions", "velocities")),
        *(MessageField(name, "float64", 0) for name in ("accelerations", "effort")),
        MessageField("time_from_start", "duration"),
    ),
}
"""Types whose ROS 1 definition has other fields than their ROS 2 definition."""


@cache
def common_types(*, is_ros1: bool = False) -> Definitions:
    """Return the definitions for ROS 2, or for ROS 1 if `is_ros1` is true."""
    found = parse_lines(_TYPES)
    if is_ros1:
        found |= {name: Definition(name, fields, {}) for name, fields in _ROS1.items()}
    return found
