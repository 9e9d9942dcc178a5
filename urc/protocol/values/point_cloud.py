"""Point clouds: a ROS message on one side, a PCD file on the other.

Pure. The value of a signal of type ``point_cloud`` is a PCD file. Its fields are x, y, z and at
most one colour field, such as the intensity. All programs for point clouds can open the file. The
values are little-endian and have four bytes each, so that a page can pass them on to the graphics
hardware. A comment contains the frame and the number of points in the message as JSON. The comment
is padded, so that the values begin at a multiple of four bytes.

If a message has more points than the signal's ``size``, the converter selects points. It divides
the points into equal parts and takes one point of each part, at a place that changes from part to
part. Every nth point would not do. A laser scanner with 16 rings sends the rings in turn, so every
16th point is on the same ring.

Messages are untrusted: their sizes are compared with their data before any memory is reserved.

A foxglove.PointCloud is read as well; its points are moved by the pose of the cloud.

Sources: sensor_msgs/PointCloud2, sensor_msgs/PointField; The PCD file format, version 0.7 (Point
Cloud Library).
"""

import json
import math
import re
import struct
import sys
from array import array
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import compress
from typing import Any, Final, NamedTuple

from urc.expressions import quoted
from urc.model.values import Reading, Signal
from urc.protocol.values.convert import BadValue, Unusable
from urc.protocol.values.foxglove_shapes import cloud_of, origin_of
from urc.protocol.values.transforms import IDENTITY, move_columns
from urc.protocol.values.vectors import bytes_of

__all__ = ["COLOURS", "POINTS", "Cloud", "cloud_converter", "cloud_message"]
__all__ += ["encode_cloud", "packed_cloud", "read_cloud"]

POINTS: Final = 20_000
"""Number of points that a point cloud keeps if `size` is not declared."""
FARTHEST_M: Final = 1e6
"""Maximum distance of a point from the origin along each axis, in metres. Points farther away are
left out, like points without coordinates."""
COLOURS: Final = ("rgb", "rgba")
"""Names of fields that contain colours, with eight bits for each of red, green and blue."""
_USUAL: Final = (*COLOURS, "intensity", "intensities", "i", "reflectivity")
"""Names of the colour fields without a declared `colour`, the preferred name first."""
_CODES: Final = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 8: "d"}
"""Format codes of `struct`, keyed by the datatype of a sensor_msgs/PointField."""
_MAX_FIELDS: Final = 64
_NAME_LETTERS: Final = 40
_FRAME_LETTERS: Final = 200
_GOLDEN: Final = (math.sqrt(5) - 1) / 2
_COMMENT: Final = "# urc point cloud "
_LONGEST_HEADER: Final = 4096
_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_]")


class Cloud(NamedTuple):
    """A point cloud, checked and thinned."""

    frame: str
    colour: str
    """Name of the fourth value; "" if each point has only three values."""
    total: int
    """Number of points in the robot's message."""
    points: bytes
    """The values of all points: float32 for x, y and z in metres. The colour field is float32, or
    uint32 (0x00RRGGBB) if it is one of `COLOURS`. All values are little-endian."""

    @property
    def stride(self) -> int:
        """Size of one point in bytes."""
        return 16 if self.colour else 12


class _Layout(NamedTuple):
    """The places of the wanted values in a point."""

    unpack: struct.Struct
    """Reader for one point; its size is at most the size of a point."""
    columns: tuple[str, ...]
    """Names of the values in the order in which they are read."""
    colour: str
    """Name of the colour field, or ""."""


def cloud_converter(signal: Signal) -> Callable[[object], Reading]:
    """Return a function that converts a message to a PCD file, or raises `BadValue`."""
    most = signal.size or POINTS

    def convert(raw: object) -> Reading:
        if raw is None:
            return None
        if isinstance(raw, bytes):  # the value itself, from a recording or an emulated robot
            read_cloud(raw)
            return raw
        if isinstance(raw, Unusable):
            raise BadValue(raw.why)
        if not isinstance(raw, Mapping):
            raise BadValue(f"{quoted(raw)} is not a point cloud")
        return encode_cloud(_cloud(raw, signal.colour, most))

    return convert


def _cloud(raw: Mapping[str, Any], colour: str, most: int) -> Cloud:
    origin = origin_of(raw)
    raw = cloud_of(raw)
    width, height, step, row = (
        _whole(raw, name) for name in ("width", "height", "point_step", "row_step")
    )
    header = raw.get("header")
    frame = header.get("frame_id") if isinstance(header, Mapping) else ""
    frame = frame[:_FRAME_LETTERS] if isinstance(frame, str) else ""
    count = width * height
    if not count:
        return Cloud(frame, "", 0, b"")
    layout = _layout(raw.get("fields"), ">" if raw.get("is_bigendian") else "<", colour)
    data = bytes_of(raw.get("data"))
    if layout.unpack.size > step:
        raise BadValue(
            f"the fields of a point take {layout.unpack.size} bytes, but its point_step is {step}"
        )
    if height == 1:
        row = width * step  # some drivers leave it at zero
    needed = (height - 1) * row + width * step
    if row < width * step or len(data) < needed:
        raise BadValue(
            f"a point cloud of {width} by {height} points of {step} bytes, with rows of {row}"
            f" bytes, needs {max(needed, count * step)} bytes, found {len(data)}"
        )
    unpack, places = layout.unpack.unpack_from, _places(width, height, step, row, most)
    columns = dict(
        zip(layout.columns, zip(*[unpack(data, at) for at in places], strict=True), strict=True)
    )
    if origin != IDENTITY:
        z = columns.get("z") or (0.0,) * len(columns["x"])
        moved = move_columns(origin, columns["x"], columns["y"], z)
        columns.update(zip("xyz", map(tuple, moved), strict=True))
    return packed_cloud(frame, layout.colour, count, columns)


def packed_cloud(
    frame: str, colour: str, total: int, columns: Mapping[str, Sequence[float]]
) -> Cloud:
    """Return a cloud of separate columns; points without finite coordinates are left out.

    Args:
        frame: name of the coordinate frame.
        colour: name of the colour field among the columns, or "".
        total: number of points in the robot's message.
        columns: the columns x and y, and optionally z and the colour field, all of the same length.
    """
    x, y = columns["x"], columns["y"]
    places = [x, y, columns.get("z") or (0.0,) * len(x)]
    column = columns[colour] if colour else ()
    ends = [end for one in places for end in (sum(one), min(one), max(one))] if x else []
    if not all(abs(end) < FARTHEST_M for end in ends):
        keep = [
            abs(a) < FARTHEST_M and abs(b) < FARTHEST_M and abs(c) < FARTHEST_M
            for a, b, c in zip(*places, strict=True)
        ]
        places = [list(compress(one, keep)) for one in places]
        column = list(compress(column, keep)) if colour else ()
    parts = [array("f", one) for one in places]
    if colour:
        parts.append(array("I", column) if colour in COLOURS else array("f", column))
    values = array("I", bytes(4 * len(parts) * len(parts[0])))
    for place, part in enumerate(parts):
        values[place :: len(parts)] = array("I", part.tobytes())
    if sys.byteorder == "big":
        values.byteswap()
    return Cloud(frame, colour, total, values.tobytes())


@lru_cache(maxsize=4)
def _places(width: int, height: int, step: int, row: int, most: int) -> Sequence[int]:
    """Return the offset of each point to keep; most robots send the same sizes in each message."""
    selected = _selected(width * height, most)
    if row == width * step:
        return [one * step for one in selected]
    return [one // width * row + one % width * step for one in selected]


def _selected(count: int, most: int) -> Sequence[int]:
    """Return the numbers of the points to keep, in increasing order."""
    if count <= most:
        return range(count)
    part = count / most
    return [min(count - 1, int(part * (one + one * _GOLDEN % 1))) for one in range(most)]


def _layout(given: object, order: str, wanted: str) -> _Layout:
    """Return the places of the wanted values in a point; raise `BadValue` if impossible."""
    fields = _fields(given)
    for name in ("x", "y", *filter(None, (wanted,))):
        if name not in fields:
            found = ", ".join(fields) or "none"
            raise BadValue(f"a point cloud without the field {name!r}; its fields are: {found}")
    colour = wanted or next((one for one in _USUAL if one in fields), "")
    chosen = [name for name in dict.fromkeys(("x", "y", "z", colour)) if name in fields]
    if colour in ("x", "y", "z"):
        colour = ""
    form, at = order, 0
    chosen.sort(key=lambda name: fields[name][0])
    for name in chosen:
        offset, code = fields[name]
        if name in COLOURS:  # the bits of a colour, even if they are declared as a number
            if struct.calcsize(f"={code}") != 4:
                raise BadValue(f"the field {name!r} of a point cloud must have 4 bytes")
            code = "I"
        if offset < at:
            raise BadValue(f"the field {name!r} of a point cloud overlaps another field")
        form += f"{offset - at}x{code}"
        at = offset + struct.calcsize(f"={code}")
    return _Layout(struct.Struct(form), tuple(chosen), colour)


def _fields(given: object) -> dict[str, tuple[int, str]]:
    """Return the offset and the format code of each field."""
    if not isinstance(given, (list, tuple)) or len(given) > _MAX_FIELDS:
        raise BadValue(
            f"{quoted(given)} is not a list of up to {_MAX_FIELDS} fields of a point cloud"
        )
    found: dict[str, tuple[int, str]] = {}
    for one in given:
        if not isinstance(one, Mapping) or not isinstance(one.get("name"), str):
            raise BadValue(f"{quoted(one)} is not a field of a point cloud")
        name, offset, kind = one["name"], _whole(one, "offset"), _whole(one, "datatype")
        if kind not in _CODES or offset > 2**16:
            raise BadValue(
                f"the field {quoted(name)} of a point cloud has the datatype {kind} and the offset"
                f" {offset}; the limits are 8 and {2**16}"
            )
        found[name[:_NAME_LETTERS]] = offset, _CODES[kind]
    return found


def _whole(raw: Mapping[str, Any], name: str) -> int:
    value = raw.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise BadValue(f"{name} of the point cloud: {quoted(value)} is not a whole number")
    return value


# -- the file


def encode_cloud(cloud: Cloud) -> bytes:
    """Return the PCD file of a cloud."""
    count = len(cloud.points) // cloud.stride
    names = ["x", "y", "z"]
    if cloud.colour:
        names.append(_UNSAFE.sub("_", cloud.colour))
    types = ["F"] * 3 + ["U" if cloud.colour in COLOURS else "F"] * (len(names) - 3)
    told = json.dumps({"frame": cloud.frame, "total": cloud.total}, separators=(",", ":"))
    lines = (
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join('4' for _ in names)}",
        f"TYPE {' '.join(types)}",
        f"COUNT {' '.join('1' for _ in names)}",
        f"WIDTH {count}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {count}",
        "DATA binary\n",
    )
    rest = "\n".join(lines)
    pad = " " * (-(len(_COMMENT) + len(told) + 1 + len(rest)) % 4)
    return f"{_COMMENT}{told}{pad}\n{rest}".encode("ascii") + cloud.points


def read_cloud(data: bytes) -> Cloud:
    """Return the cloud in a file that `encode_cloud` has made; raise `BadValue` for any other."""
    head, mark, _ = data[:_LONGEST_HEADER].partition(b"DATA binary\n")
    try:
        first, *lines = head.decode("ascii").splitlines()
        told = json.loads(first.removeprefix(_COMMENT))
        keys = dict(line.split(" ", 1) for line in lines)
        names, count = keys["FIELDS"].split(), int(keys["POINTS"])
        frame, total = str(told["frame"]), int(told["total"])
    except (KeyError, TypeError, ValueError, RecursionError) as fault:
        raise BadValue(f"the file is not a point cloud of URC ({fault})") from None
    points = data[len(head) + len(mark) :]
    cloud = Cloud(frame, names[3] if len(names) == 4 else "", total, points)
    if not mark or names[:3] != ["x", "y", "z"] or len(names) > 4:
        raise BadValue("the file is not a point cloud of URC")
    if len(points) != count * cloud.stride:
        raise BadValue(f"{count} points need {count * cloud.stride} bytes, found {len(points)}")
    return cloud


def cloud_message(data: bytes) -> dict[str, Any]:
    """Return the message of a file, for emulated robots; raise `BadValue` for other files."""
    cloud = read_cloud(data)
    names = ("x", "y", "z", cloud.colour)[: cloud.stride // 4]
    fields = [
        {"name": name, "offset": 4 * place, "datatype": 6 if name in COLOURS else 7, "count": 1}
        for place, name in enumerate(names)
    ]
    return {
        "header": {"frame_id": cloud.frame},
        "height": 1,
        "width": len(cloud.points) // cloud.stride,
        "fields": fields,
        "is_bigendian": False,
        "point_step": cloud.stride,
        "row_step": len(cloud.points),
        "data": b64encode(cloud.points).decode("ascii"),
        "is_dense": True,
    }
