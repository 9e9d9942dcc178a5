"""Occupancy grids: a ROS message on one side, an indexed PNG image on the other.

Pure. The value of a signal of type ``occupancy_grid`` is a PNG image with one pixel per cell. The
image is encoded once, and then travels like a camera image. Encoding a large grid takes long, so a
live session receives the grid as an `UnencodedGrid`, and encodes it in a thread. A palette
index is the cell's byte in the message: 0 to 100 is the occupancy in percent, and 255 (−1) is
unknown. The first row of the image is the far end of the grid's y axis, so that every image viewer
shows the map upright. The text chunk `KEYWORD` contains the frame, the resolution and the origin as
JSON, so the cells and their place can't get out of step.

An update replaces a rectangle of the last complete grid. Messages are untrusted: their sizes are
compared with their data before any memory is reserved.

Sources: nav_msgs/OccupancyGrid, map_msgs/OccupancyGridUpdate; PNG (ISO/IEC 15948, 11.2 and
11.3.4.3).
"""

import json
import math
import struct
import sys
import zlib
from array import array
from collections.abc import Mapping
from typing import Any, Final, NamedTuple, cast

from urc.expressions import quoted
from urc.model.values import Reading
from urc.protocol.values.convert import BadValue, Unusable

__all__ = ["KEYWORD", "MAX_CELLS", "MAX_SIDE", "Grid", "GridConverter", "UnencodedGrid"]
__all__ += ["encode_grid", "grid_message", "read_grid"]

MAX_CELLS: Final = 4_000_000
"""Maximum number of cells in an occupancy grid. A thread encodes this many cells in up to 0.5 s;
meanwhile, the server works on."""
MAX_SIDE: Final = 8192
"""Maximum number of cells along one side of an occupancy grid. Larger images can't be drawn by the
graphics hardware of many phones."""
FARTHEST_M: Final = 4e7
"""Maximum distance of an occupancy grid's origin in metres: the Earth's circumference."""
KEYWORD: Final = "urc occupancy grid"
"""Keyword of the text chunk with the frame, the resolution and the origin."""
_MAGIC: Final = b"\x89PNG\r\n\x1a\n"
_LEVEL: Final = 1
"""Compression level: higher levels take three times as long and save a quarter."""
_UNKNOWN_GREY: Final = 205
_FREE_GREY: Final = 254
_FULL: Final = 100
"""Value of a cell that is certainly occupied."""
_FRAME_LETTERS: Final = 200


class Grid(NamedTuple):
    """A complete occupancy grid, checked."""

    width: int
    """Number of cells along x."""
    height: int
    """Number of cells along y."""
    resolution: float
    """Side of a cell in metres."""
    x: float
    """Position of the corner of the first cell, in metres in `frame`."""
    y: float
    yaw: float
    """Direction of the grid's x axis in radians, counter-clockwise."""
    frame: str
    cells: bytes
    """One byte per cell, row by row from the origin; 255 means unknown."""


class UnencodedGrid:
    """A grid in place of its image, as the value of a sample that still has to be encoded."""

    __slots__ = ("grid",)

    def __init__(self, grid: Grid) -> None:
        """Store the grid; the same grid always means the same image."""
        self.grid = grid

    def __eq__(self, other: object) -> bool:
        return isinstance(other, UnencodedGrid) and self.grid is other.grid

    def __hash__(self) -> int:
        return id(self.grid)


class GridConverter:
    """The conversion of grids and updates to images, for one signal of one connection.

    The object keeps the last complete grid, because an update has no value of its own.
    """

    def __init__(self) -> None:
        self._last: Grid | None = None
        self._image = b""
        self.is_deferring = False
        """Whether values are `UnencodedGrid` objects instead of images."""

    def __call__(self, raw: object) -> Reading:
        """Return the image of a message, or of the last grid with an update.

        Raises:
            BadValue: the message is invalid, or an update does not fit the last grid.
        """
        if raw is None:
            return None
        if not isinstance(raw, Mapping):
            if isinstance(raw, bytes):  # the value itself, from a recording or an emulated robot
                read_grid(raw)
                return raw
            if isinstance(raw, Unusable):
                raise BadValue(raw.why)
            raise BadValue(f"{quoted(raw)} is not an occupancy grid")
        if "info" in raw:
            grid = _grid(raw)
            if grid is None:
                self._last, self._image = None, b""
                return None
        else:
            grid = self._updated(raw)
        if self._last is None or grid != self._last:
            self._last, self._image = grid, b""
        if self.is_deferring:
            return cast("Reading", UnencodedGrid(self._last))
        self._image = self._image or encode_grid(self._last)
        return self._image

    def forget(self) -> None:
        """Drop the last grid: after a reconnection, an update must wait for a complete grid."""
        self._last, self._image = None, b""

    def _updated(self, raw: Mapping[str, Any]) -> Grid:
        last = self._last
        x, y, width, height = (_whole(raw, name) for name in ("x", "y", "width", "height"))
        if last is None:
            raise BadValue("an update of an occupancy grid arrived before the grid")
        if x + width > last.width or y + height > last.height:
            raise BadValue(
                f"an update of {width} by {height} cells at {x}, {y} is outside the grid of"
                f" {last.width} by {last.height} cells"
            )
        patch = _cells(raw, width, height)
        cells = bytearray(last.cells)
        for row in range(height):
            at = (y + row) * last.width + x
            cells[at : at + width] = patch[row * width : (row + 1) * width]
        return last._replace(cells=bytes(cells))


def _grid(raw: Mapping[str, Any]) -> Grid | None:
    """Return a message as a grid; None for a grid without cells, as sent before the first scan."""
    info, header = raw.get("info"), raw.get("header")
    if not isinstance(info, Mapping):
        raise BadValue(f"{quoted(info)} is not the info of an occupancy grid")
    width, height = (_whole(info, name) for name in ("width", "height"))
    if not width * height:
        if len(_bytes(raw.get("data"))):
            raise BadValue(f"a grid of {width} by {height} cells cannot have data")
        return None
    if max(width, height) > MAX_SIDE or width * height > MAX_CELLS:
        raise BadValue(
            f"a grid of {width} by {height} cells; the limits are {MAX_CELLS} cells and {MAX_SIDE}"
            " cells per side"
        )
    resolution = _number(info, "resolution", "resolution")
    if not 0 < resolution <= FARTHEST_M:
        raise BadValue(f"a resolution of {resolution:g} m; expected a length above 0")
    x, y, yaw = _origin(info)
    frame = header.get("frame_id") if isinstance(header, Mapping) else ""
    frame = frame[:_FRAME_LETTERS] if isinstance(frame, str) else ""
    return Grid(width, height, resolution, x, y, yaw, frame, _cells(raw, width, height))


def _origin(info: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return x, y and yaw; the roll and pitch of a map on the ground are meaningless."""
    origin = info.get("origin")
    place, turn = (
        part if isinstance(part, Mapping) else {}
        for part in (
            (origin.get("position"), origin.get("orientation"))
            if isinstance(origin, Mapping)
            else (None, None)
        )
    )
    x, y = (_number(place, name, f"origin {name}") for name in ("x", "y"))
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise BadValue(f"an origin at {x:g}, {y:g} m; the limit is {FARTHEST_M:g} m")
    qx, qy, qz, qw = (_number(turn, name, f"origin {name}", 0.0) for name in ("x", "y", "z", "w"))
    yaw = math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    if not math.isfinite(yaw):
        raise BadValue("the orientation of the grid's origin is not a rotation")
    return x, y, yaw


def _cells(raw: Mapping[str, Any], width: int, height: int) -> bytes:
    data = _bytes(raw.get("data"))
    if len(data) != width * height:
        raise BadValue(
            f"a grid of {width} by {height} cells needs {width * height} values, found {len(data)}"
        )
    return data


def _bytes(data: object) -> bytes:
    """Return the cells as bytes; a list has numbers from −128 to 127."""
    if isinstance(data, (bytes, bytearray, memoryview)):
        return bytes(data)
    if not isinstance(data, (list, tuple)):
        raise BadValue(f"{quoted(data)} is not the data of an occupancy grid")
    try:
        return array("b", data).tobytes()
    except (TypeError, ValueError, OverflowError):
        raise BadValue("the data of the grid are not numbers from -128 to 127") from None


def _whole(raw: Mapping[str, Any], name: str) -> int:
    value = raw.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise BadValue(f"{name} of the grid: {quoted(value)} is not a number of cells")
    return value


def _number(raw: Mapping[str, Any], name: str, told: str, usual: float | None = None) -> float:
    value = raw.get(name, usual)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not abs(value) <= sys.float_info.max:
        raise BadValue(f"{told} of the grid: {quoted(value)} is not a number")
    return float(value)


# -- the image


def _palette() -> bytes:
    """Return the colours of map_server's images: free is white, occupied black, unknown grey."""
    known = [round(_FREE_GREY * (1 - value / _FULL)) for value in range(_FULL + 1)]
    return b"".join(bytes((grey,) * 3) for grey in known + [_UNKNOWN_GREY] * (255 - _FULL))


_PALETTE: Final = _palette()


def encode_grid(grid: Grid) -> bytes:
    """Return the image of a grid."""
    width, height, cells = grid.width, grid.height, grid.cells
    place = {name: getattr(grid, name) for name in ("frame", "resolution", "x", "y", "yaw")}
    text = json.dumps(place, separators=(",", ":")).encode("ascii")
    rows = b"\0" + b"\0".join(
        cells[at : at + width] for at in range((height - 1) * width, -1, -width)
    )
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
        (b"PLTE", _PALETTE),
        (b"tEXt", KEYWORD.encode("ascii") + b"\0" + text),
        (b"IDAT", zlib.compress(rows, _LEVEL)),
        (b"IEND", b""),
    )
    return _MAGIC + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in parts
    )


def read_grid(image: bytes) -> Grid:
    """Return the grid in an image that `encode_grid` has made; raise `BadValue` for any other."""
    try:
        chunks = dict(_chunks(image))
        width, height = struct.unpack_from(">II", chunks[b"IHDR"])
        place = json.loads(chunks[b"tEXt"].partition(b"\0")[2])
        if not 0 < width * height <= MAX_CELLS or max(width, height) > MAX_SIDE:
            raise BadValue(f"an image of {width} by {height} cells")
        size = height * (width + 1)
        rows = zlib.decompressobj().decompress(chunks[b"IDAT"], size)
        cells = b"".join(
            rows[at + 1 : at + 1 + width] for at in range(size - width - 1, -1, -width - 1)
        )
        resolution, x, y, yaw = (float(place[name]) for name in ("resolution", "x", "y", "yaw"))
        frame = str(place["frame"])
    except (KeyError, TypeError, ValueError, struct.error, zlib.error, RecursionError) as fault:
        raise BadValue(f"the image is not an occupancy grid ({fault})") from None
    if len(cells) != width * height or not math.isfinite(resolution + x + y + yaw):
        raise BadValue("the image of an occupancy grid ends too early")
    return Grid(width, height, resolution, x, y, yaw, frame, cells)


def grid_message(image: bytes) -> dict[str, Any]:
    """Return the message of an image, for emulated robots; raise `BadValue` for other images."""
    grid = read_grid(image)
    half = grid.yaw / 2
    return {
        "header": {"frame_id": grid.frame},
        "info": {
            "resolution": grid.resolution,
            "width": grid.width,
            "height": grid.height,
            "origin": {
                "position": {"x": grid.x, "y": grid.y, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
            },
        },
        "data": array("b", grid.cells).tolist(),
    }


def _chunks(image: bytes) -> "list[tuple[bytes, bytes]]":
    found, at = [], len(_MAGIC)
    if not image.startswith(_MAGIC):
        raise ValueError("no PNG signature")
    while at + 12 <= len(image):
        length, kind = cast("tuple[int, bytes]", struct.unpack_from(">I4s", image, at))
        found.append((kind, image[at + 8 : at + 8 + length]))
        at += length + 12
    return found
