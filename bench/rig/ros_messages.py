"""Random ROS messages and their bytes, made with the library rosbags.

rosbags, by Ternaris, is independent of URC. The library includes a ROS 2 type store, and serializes
to CDR and to the ROS 1 format. The values of a message are compared as plain data, as URC reads
them. Non-finite numbers become None, and arrays of ``uint8`` become bytes.
"""

import math
import random
from collections.abc import Sequence
from typing import Any, Final

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

__all__ = ["ROS1", "ROS2", "TYPES", "RandomMessages", "plain"]

ROS2: Final = get_typestore(Stores.ROS2_JAZZY)
ROS1: Final = get_typestore(Stores.ROS1_NOETIC)

TYPES: Final = (
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/JointState",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rcl_interfaces/msg/Log",
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/BatteryState",
    "sensor_msgs/msg/Joy",
    "tf2_msgs/msg/TFMessage",
    "nav_msgs/msg/OccupancyGrid",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PoseArray",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PolygonStamped",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/Twist",
)
"""Types of the messages that mobile robots publish."""

_DTYPES: Final = {
    "bool": "bool", "byte": "uint8", "char": "uint8", "octet": "uint8", "int8": "int8",
    "uint8": "uint8", "int16": "int16", "uint16": "uint16", "int32": "int32", "uint32": "uint32",
    "int64": "int64", "uint64": "uint64", "float32": "float32", "float64": "float64",
}  # fmt: skip
_CONSTANTS: Final = {
    kind: {"__msgtype__", *(constant[0] for constant in store.fielddefs[name][0])}
    for store in (ROS2, ROS1)
    for name, kind in store.types.items()
}
"""Names that are constants, not fields, keyed by class; rosbags declares both alike."""
_TIMES: Final = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_LONG_SHARE: Final = 1 / 500
"""Share of strings and sequences that may be long."""
_LONGEST: Final = 3000
_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz_/ 0123456789äß€漢😀"
_STRANGE: Final = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e308, 5e-324)


class RandomMessages:
    """A source of random messages, whose strings and sequences are usually empty or short."""

    def __init__(self, store: Typestore, seed: int) -> None:
        self._store = store
        self._dice = random.Random(seed)  # noqa: S311 - the same messages in every run
        self._numbers = numpy.random.default_rng(seed)

    def message(self, name: str) -> Any:
        """Return a random message of a type, as a rosbags object."""
        if name in _TIMES:  # rosbags supports only the times of ROS 2, which have a different sign
            return self._store.types[name](self._dice.randrange(2**31), self._dice.randrange(10**9))
        described = self._store.fielddefs[name][1]
        values = {field: self._value(kind) for field, kind in described}
        return self._store.types[name](**values)

    def _value(self, description: Any) -> Any:
        kind, detail = description
        match kind:
            case Nodetype.BASE:
                return self._single(detail[0])
            case Nodetype.NAME:
                return self.message(detail)
            case Nodetype.ARRAY:
                return self._several(detail[0], detail[1])
            case _:
                return self._several(detail[0], self._length())

    def _length(self) -> int:
        if self._dice.random() < _LONG_SHARE:
            return self._dice.randrange(_LONGEST)
        return self._dice.choice((0, 0, 1, 2, 3, self._dice.randrange(40)))

    def _single(self, name: str) -> Any:
        if name == "string":
            return "".join(self._dice.choices(_LETTERS, k=self._length()))
        value = self._array(name, 1)[0]
        return value.item()

    def _several(self, description: Any, count: int) -> Any:
        kind, detail = description
        if kind == Nodetype.BASE and detail[0] != "string":
            return self._array(detail[0], count)
        return [self._value(description) for _ in range(count)]

    def _array(self, name: str, count: int) -> Any:
        dtype = numpy.dtype(_DTYPES[name])
        if dtype.kind == "f":
            made = (self._numbers.standard_normal(count) * 1000).astype(dtype)
            if count and self._dice.random() < 0.1:
                with numpy.errstate(all="ignore"):
                    made[self._dice.randrange(count)] = self._dice.choice(_STRANGE)
            return made
        if dtype.kind == "b":
            return self._numbers.integers(0, 2, count).astype(bool)
        span = numpy.iinfo(dtype)
        # rosbags packs `byte` with a sign, unlike ROS 2.
        most = 127 if name == "byte" else span.max
        return self._numbers.integers(span.min, most, count, dtype=dtype, endpoint=True)


def plain(value: Any) -> Any:
    """Return a rosbags value as plain data."""
    if isinstance(value, numpy.ndarray):
        if value.dtype == numpy.uint8:
            return value.tobytes()
        if value.dtype.kind == "f":
            return [float(one) if math.isfinite(one) else None for one in value.tolist()]
        return value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(one) for one in value]
    if hasattr(value, "__msgtype__"):
        names = [name for name in value.__dataclass_fields__ if name not in _CONSTANTS[type(value)]]
        return {name: plain(getattr(value, name)) for name in names}
    return value
