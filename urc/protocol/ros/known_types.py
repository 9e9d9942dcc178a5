"""Further types of ROS 2, for connections on which a robot sends no definitions.

rmw_zenoh sends the name and the hash of each type, but not its definition. A type is used only if
its hash is the same as the robot's.

Sources: common_interfaces, geometry2 and rcl_interfaces, from ROS 2 Jazzy.
"""

from functools import cache
from typing import Final

from urc.protocol.ros.common_types import common_types
from urc.protocol.ros.definition import BadDefinition, Definitions, plain_name
from urc.protocol.ros.msg_text import parse_lines
from urc.protocol.ros.type_hash import type_hash

__all__ = ["NO_HASH", "check_known", "known_hash", "known_types"]

NO_HASH: Final = "TypeHashNotSupported"
"""The hash of every type in ROS 2 Humble."""

_TYPES: Final = """\
diagnostic_msgs/DiagnosticArray: Header header, DiagnosticStatus[] status
diagnostic_msgs/DiagnosticStatus: byte level, string name, string message, string hardware_id,
  KeyValue[] values
diagnostic_msgs/KeyValue: string key, string value
geometry_msgs/PolygonInstance: Polygon polygon, int64 id
geometry_msgs/PolygonInstanceStamped: Header header, PolygonInstance polygon
geometry_msgs/VelocityStamped: Header header, string body_frame_id, string reference_frame_id,
  Twist velocity
nav_msgs/GridCells: Header header, float32 cell_width, float32 cell_height,
  geometry_msgs/Point[] cells
nav_msgs/MapMetaData: builtin_interfaces/Time map_load_time, float32 resolution, uint32 width,
  uint32 height, geometry_msgs/Pose origin
nav_msgs/OccupancyGrid: Header header, MapMetaData info, int8[] data
rcl_interfaces/Log: builtin_interfaces/Time stamp, uint8 level, string name, string msg, string
  file, string function, uint32 line
rosgraph_msgs/Clock: builtin_interfaces/Time clock
sensor_msgs/BatteryState: Header header, float32 voltage, float32 temperature, float32 current,
  float32 charge, float32 capacity, float32 design_capacity, float32 percentage, uint8
  power_supply_status, uint8 power_supply_health, uint8 power_supply_technology, bool present,
  float32[] cell_voltage, float32[] cell_temperature, string location, string serial_number
sensor_msgs/CameraInfo: Header header, uint32 height, uint32 width, string distortion_model,
  float64[] d, float64[9] k, float64[9] r, float64[12] p, uint32 binning_x, uint32 binning_y,
  RegionOfInterest roi
sensor_msgs/ChannelFloat32: string name, float32[] values
sensor_msgs/FluidPressure: Header header, float64 fluid_pressure, float64 variance
sensor_msgs/Illuminance: Header header, float64 illuminance, float64 variance
sensor_msgs/Image: Header header, uint32 height, uint32 width, string encoding, uint8
  is_bigendian, uint32 step, uint8[] data
sensor_msgs/Imu: Header header, geometry_msgs/Quaternion orientation, float64[9]
  orientation_covariance, geometry_msgs/Vector3 angular_velocity, float64[9]
  angular_velocity_covariance, geometry_msgs/Vector3 linear_acceleration, float64[9]
  linear_acceleration_covariance
sensor_msgs/LaserEcho: float32[] echoes
sensor_msgs/LaserScan: Header header, float32 angle_min, float32 angle_max, float32
  angle_increment, float32 time_increment, float32 scan_time, float32 range_min, float32
  range_max, float32[] ranges, float32[] intensities
sensor_msgs/MagneticField: Header header, geometry_msgs/Vector3 magnetic_field, float64[9]
  magnetic_field_covariance
sensor_msgs/MultiDOFJointState: Header header, string[] joint_names, geometry_msgs/Transform[]
  transforms, geometry_msgs/Twist[] twist, geometry_msgs/Wrench[] wrench
sensor_msgs/MultiEchoLaserScan: Header header, float32 angle_min, float32 angle_max, float32
  angle_increment, float32 time_increment, float32 scan_time, float32 range_min, float32
  range_max, LaserEcho[] ranges, LaserEcho[] intensities
sensor_msgs/PointCloud: Header header, geometry_msgs/Point32[] points, ChannelFloat32[] channels
sensor_msgs/PointCloud2: Header header, uint32 height, uint32 width, PointField[] fields, bool
  is_bigendian, uint32 point_step, uint32 row_step, uint8[] data, bool is_dense
sensor_msgs/PointField: string name, uint32 offset, uint8 datatype, uint32 count
sensor_msgs/Range: Header header, uint8 radiation_type, float32 field_of_view, float32
  min_range, float32 max_range, float32 range, float32 variance
sensor_msgs/RelativeHumidity: Header header, float64 relative_humidity, float64 variance
sensor_msgs/Temperature: Header header, float64 temperature, float64 variance
sensor_msgs/TimeReference: Header header, builtin_interfaces/Time time_ref, string source
shape_msgs/Mesh: MeshTriangle[] triangles, geometry_msgs/Point[] vertices
shape_msgs/MeshTriangle: uint32[3] vertex_indices
shape_msgs/Plane: float64[4] coef
shape_msgs/SolidPrimitive: uint8 type, float64[<=3] dimensions, geometry_msgs/Polygon polygon
std_msgs/ByteMultiArray: MultiArrayLayout layout, byte[] data
std_msgs/Int16MultiArray: MultiArrayLayout layout, int16[] data
std_msgs/Int64MultiArray: MultiArrayLayout layout, int64[] data
std_msgs/Int8MultiArray: MultiArrayLayout layout, int8[] data
std_msgs/UInt16MultiArray: MultiArrayLayout layout, uint16[] data
std_msgs/UInt32MultiArray: MultiArrayLayout layout, uint32[] data
std_msgs/UInt64MultiArray: MultiArrayLayout layout, uint64[] data
std_msgs/UInt8MultiArray: MultiArrayLayout layout, uint8[] data
stereo_msgs/DisparityImage: Header header, sensor_msgs/Image image, float32 f, float32 t,
  sensor_msgs/RegionOfInterest valid_window, float32 min_disparity, float32 max_disparity,
  float32 delta_d
tf2_msgs/TFMessage: geometry_msgs/TransformStamped[] transforms
trajectory_msgs/MultiDOFJointTrajectory: Header header, string[] joint_names,
  MultiDOFJointTrajectoryPoint[] points
trajectory_msgs/MultiDOFJointTrajectoryPoint: geometry_msgs/Transform[] transforms,
  geometry_msgs/Twist[] velocities, geometry_msgs/Twist[] accelerations,
  builtin_interfaces/Duration time_from_start
visualization_msgs/Marker: Header header, string ns, int32 id, int32 type, int32 action,
  geometry_msgs/Pose pose, geometry_msgs/Vector3 scale, std_msgs/ColorRGBA color,
  builtin_interfaces/Duration lifetime, bool frame_locked, geometry_msgs/Point[] points,
  std_msgs/ColorRGBA[] colors, string texture_resource, sensor_msgs/CompressedImage texture,
  UVCoordinate[] uv_coordinates, string text, string mesh_resource, MeshFile mesh_file, bool
  mesh_use_embedded_materials
visualization_msgs/MarkerArray: Marker[] markers
visualization_msgs/MeshFile: string filename, uint8[] data
visualization_msgs/UVCoordinate: float32 u, float32 v
"""


@cache
def known_types() -> Definitions:
    """Return the definitions of all types of ROS 2 that URC knows."""
    return {**common_types(), **parse_lines(_TYPES)}


def check_known(name: str, hashed: str) -> None:
    """Raise `BadDefinition` if URC does not know a type, or knows another definition of it."""
    own = known_hash(name)
    if not own:
        raise BadDefinition(f"URC does not know the type {name}; use via: foxglove")
    if hashed not in (own, NO_HASH):
        raise BadDefinition(
            f"the robot's definition of {name} differs from URC's; use via: foxglove"
        )


@cache
def known_hash(name: str) -> str:
    """Return the hash of a known type, whose name may have any form; "" for other types."""
    try:
        return type_hash(plain_name(name), known_types())
    except BadDefinition:
        return ""
