"""Messages with images: raw pixels of ROS on one side, an image file on the other.

Pure. A raw image becomes a JPEG or PNG file, encoded once, and then travels like any other image.
Colours and 8-bit grey become JPEG. Grey with 16 bits and depths become a PNG with 16 bits: they are
measurements, and JPEG would change them. A depth of 0 mm means unknown.

Messages are untrusted: their sizes are compared with their data before any memory is reserved.

Sources: sensor_msgs/Image, sensor_msgs/image_encodings; sensor_msgs/CompressedImage with
compressed_depth_image_transport; ITU-R BT.601 (range of YUV).
"""

import io
import struct
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from urc._extras import missing
from urc.expressions import quoted
from urc.protocol.values.convert import BadValue

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["ENCODINGS", "MAX_16_BIT_PIXELS", "MAX_RAW_PIXELS", "picture_of"]

MAX_RAW_PIXELS: Final = 4_200_000
"""Maximum number of pixels in a raw image. Encoding this many pixels takes up to 30 ms."""
MAX_16_BIT_PIXELS: Final = 2_100_000
"""Maximum number of pixels in a raw image with 16 bits or with depths. Encoding this many pixels
takes up to 160 ms."""
_QUALITY: Final = 80
_LEVEL: Final = 1
_DEPTH_HEADER: Final = struct.Struct("<iff")
"""Header before a compressed depth image: its format, and two numbers for 32FC1."""
_PNG: Final = b"\x89PNG"
_MILLIMETRES: Final = 1000.0


class _Raw(NamedTuple):
    """A raw image whose sizes are checked."""

    width: int
    height: int
    step: int
    """Number of bytes from one row to the next."""
    is_big: bool
    """Whether numbers with several bytes are big-endian."""
    data: bytes

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    def rows(self, length: int, first: int = 0, every: int = 1) -> bytes:
        """Return the first `length` bytes of every nth row, without padding."""
        step, data = self.step, self.data
        if first == 0 and every == 1 and step == length:
            return data[: step * self.height]
        starts = range(first * step, self.height * step, every * step)
        return b"".join(data[at : at + length] for at in starts)


def picture_of(raw: Mapping[str, Any], bytes_of: Callable[[object], bytes]) -> bytes:
    """Return the image file of a sensor_msgs/Image or a sensor_msgs/CompressedImage.

    Args:
        raw: fields of the message.
        bytes_of: function that converts the field ``data`` to bytes.

    Raises:
        BadValue: the message is invalid, or its encoding is not supported.
    """
    if "encoding" not in raw:
        if "format" not in raw or "data" not in raw:
            raise BadValue(f"{quoted(raw)} is neither bytes nor an image message")
        return _compressed(str(raw["format"]), bytes_of(raw["data"]))
    name = raw["encoding"]
    encoding = ENCODINGS.get(name) if isinstance(name, str) else None
    if encoding is None:
        raise BadValue(f"the encoding {quoted(name)} of an image is not supported")
    width, height, step = (_whole(raw, key) for key in ("width", "height", "step"))
    if not width * height:
        raise BadValue("an image without pixels")
    most = MAX_16_BIT_PIXELS if encoding in _MEASURED else MAX_RAW_PIXELS
    if width * height > most:
        raise BadValue(f"an image of {width} by {height} pixels in {name}; the limit is {most}")
    length = width * encoding.pixel_bytes
    data = bytes_of(raw.get("data"))
    needed = (height - 1) * step + length
    if step < length or len(data) < needed:
        raise BadValue(
            f"an image of {width} by {height} pixels in {name}, with rows of {step} bytes, needs"
            f" {max(needed, length * height)} bytes, found {len(data)}"
        )
    if width % encoding.block or height % encoding.block_rows:
        raise BadValue(f"an image in {name} cannot have {width} by {height} pixels")
    if find_spec("PIL") is None:
        raise BadValue(missing("raw images need", "pillow", "images"))
    image = encoding.read(_Raw(width, height, step, bool(raw.get("is_bigendian")), data))
    return _file_of(image)


def _compressed(form: str, data: bytes) -> bytes:
    """Return the image file in a compressed message."""
    if "compressedDepth" not in form:
        return data
    if "rvl" in form.lower():
        raise BadValue("a depth image compressed with RVL is not supported; use PNG")
    is_whole = form.startswith("32FC1")  # the header is needed to compute its depths
    if is_whole or data[_DEPTH_HEADER.size :][: len(_PNG)] != _PNG:
        return data
    return data[_DEPTH_HEADER.size :]


def _file_of(image: "Image.Image") -> bytes:
    file = io.BytesIO()
    if image.mode.startswith("I"):
        image.save(file, "PNG", compress_level=_LEVEL)
    else:
        image.save(file, "JPEG", quality=_QUALITY)
    return file.getvalue()


def _whole(raw: Mapping[str, Any], name: str) -> int:
    value = raw.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise BadValue(f"{name} of the image: {quoted(value)} is not a whole number")
    return value


# -- pixels


def _packed(mode: str, form: str, big: str = "") -> Callable[[_Raw], "Image.Image"]:
    """Return a function for pixels that Pillow can unpack.

    Args:
        mode: mode of the image.
        form: Pillow's name of the packed pixels.
        big: name of the packed pixels in big-endian order, if it differs.
    """

    def read(raw: _Raw) -> "Image.Image":
        from PIL import Image

        packed = big if raw.is_big and big else form
        # The last row of a message need not be padded.
        data = raw.data + bytes(max(0, raw.step * raw.height - len(raw.data)))
        return Image.frombytes(mode, raw.size, data, "raw", packed, raw.step, 1)

    return read


def _metres(raw: _Raw) -> "Image.Image":
    """Return depths in metres as depths in millimetres, at most 65,535; 0 means unknown."""
    from PIL import Image

    first = 0 if raw.is_big else 3
    is_odd = Image.frombytes("L", raw.size, raw.rows(4 * raw.width)[first::4]).point(_ODD)
    depths = _packed("F", "F;32F", "F;32BF")(raw).point(lambda one: one * _MILLIMETRES + 0.5)
    depths.paste(0, mask=is_odd)
    return depths.convert("I").convert("I;16")


_ODD: Final = [255 if one & 0x7F >= 0x48 else 0 for one in range(256)]
"""For the first byte of a float32, 255 if the number is beyond 131 km, infinite or no number. Each
processor would convert such a number to another integer."""


def _yuv(luma: int, blue: int, red: int) -> Callable[[_Raw], "Image.Image"]:
    """Return a function for YUV 4:2:2 with the given places in a group of four bytes."""

    def read(raw: _Raw) -> "Image.Image":
        from PIL import Image

        data = raw.rows(2 * raw.width)
        half = raw.width // 2, raw.height
        grey = Image.frombytes("L", raw.size, data[luma::2]).point(_full_range(219))
        colours = [
            Image.frombytes("L", half, data[place::4])
            .point(_full_range(224))
            .resize(raw.size, Image.Resampling.NEAREST)
            for place in (blue, red)
        ]
        return Image.merge("YCbCr", [grey, *colours])

    return read


@cache
def _full_range(span: int) -> list[int]:
    """Return the table from the range of BT.601 (16 to 16 + `span`) to the full range of JPEG."""
    if span == 219:
        return [min(255, max(0, round((one - 16) * 255 / span))) for one in range(256)]
    return [min(255, max(0, round((one - 128) * 255 / span + 128))) for one in range(256)]


def _bayer(pattern: str) -> Callable[[_Raw], "Image.Image"]:
    """Return a function for a Bayer pattern, such as ``rggb``; the image has half the size."""
    places = {"r": pattern.index("r"), "b": pattern.index("b")}
    greens = [place for place, letter in enumerate(pattern) if letter == "g"]

    def read(raw: _Raw) -> "Image.Image":
        from PIL import Image, ImageChops

        rows = [raw.rows(raw.width, first, 2) for first in (0, 1)]
        half = raw.width // 2, raw.height // 2

        def plane(place: int) -> "Image.Image":
            return Image.frombytes("L", half, rows[place // 2][place % 2 :: 2])

        green = ImageChops.add(plane(greens[0]), plane(greens[1]), 2)
        return Image.merge("RGB", [plane(places["r"]), green, plane(places["b"])])

    return read


class _Encoding(NamedTuple):
    """One pixel format of ROS."""

    pixel_bytes: int
    read: Callable[[_Raw], "Image.Image"]
    block: int = 1
    """Number that the width must be a multiple of."""
    block_rows: int = 1
    """Number that the height must be a multiple of."""


_RGB: Final = _Encoding(3, _packed("RGB", "RGB"))
_BGR: Final = _Encoding(3, _packed("RGB", "BGR"))
_BGRA: Final = _Encoding(4, _packed("RGB", "BGRX"))
_GREY: Final = _Encoding(1, _packed("L", "L"))
_GREY16: Final = _Encoding(2, _packed("I;16", "I;16", "I;16B"))
_UYVY: Final = _Encoding(2, _yuv(1, 0, 2), 2)
_YUYV: Final = _Encoding(2, _yuv(0, 1, 3), 2)
_DEPTH: Final = _Encoding(4, _metres)
_MEASURED: Final = (_GREY16, _DEPTH)
ENCODINGS: Final[Mapping[str, _Encoding]] = {
    "rgb8": _RGB,
    "bgr8": _BGR,
    "8UC3": _BGR,
    "rgba8": _Encoding(4, _packed("RGB", "RGBX")),
    "bgra8": _BGRA,
    "8UC4": _BGRA,
    "mono8": _GREY,
    "8UC1": _GREY,
    "mono16": _GREY16,
    "16UC1": _GREY16,
    "32FC1": _DEPTH,
    "yuv422": _UYVY,
    "uyvy": _UYVY,
    "yuv422_yuy2": _YUYV,
    "yuyv": _YUYV,
    **{
        f"bayer_{name}8": _Encoding(1, _bayer(name), 2, 2)
        for name in ("rggb", "bggr", "gbrg", "grbg")
    },
}
"""Supported pixel formats, keyed by their names in ROS."""
