"""Composite values: arrays, objects, and binary data such as images.

Pure. Raw composite values are JSON-like data, bytes, or text. In text, array elements are separated
by blanks, commas or semicolons, and bytes are in base64. The size of a frame limits the size of its
composite values.
"""

import re
from binascii import Error as Base64Error
from binascii import a2b_base64, b2a_base64
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

from urc.expressions import quoted
from urc.images import MAX_PIXELS, picture_size, pixels
from urc.model.values import Reading, Signal, Value
from urc.protocol.values.convert import BadValue
from urc.protocol.values.ros_image import picture_of
from urc.video import JPEG, read_unit

__all__ = [
    "MAX_BYTES",
    "MAX_ELEMENTS",
    "Elements",
    "array_converter",
    "bytes_converter",
    "bytes_of",
    "bytes_text",
]
__all__ += ["elements_of", "object_converter", "video_converter"]

MAX_ELEMENTS = 65536
"""Maximum number of elements in an array."""
MAX_BYTES = 1 << 24
"""Maximum size of an image or blob if ``size`` is not declared, in bytes."""
Elements = list[object] | tuple[object, ...]
_BETWEEN = re.compile(r"[\s,;]+")
_AROUND = " \t\r\n[]()"


def array_converter(
    signal: Signal, element: Callable[[object], Value], are_values: Callable[[Elements], bool]
) -> Callable[[object], Reading]:
    """Return a function that converts raw elements to a tuple.

    Args:
        signal: the signal.
        element: function that converts one element.
        are_values: function that returns whether all elements are values already.
    """
    wanted = signal.size

    def convert(raw: object) -> Reading:
        if raw is None:
            return None
        items = elements_of(raw)
        if wanted is not None and len(items) != wanted:
            raise BadValue(f"expected {wanted} elements, found {len(items)}")
        if len(items) > MAX_ELEMENTS:
            raise BadValue(f"expected at most {MAX_ELEMENTS} elements, found {len(items)}")
        if are_values(items):
            return tuple(cast("Sequence[Value]", items))
        values = []
        for place, item in enumerate(items):
            try:
                values.append(element(item))
            except BadValue as error:
                raise BadValue(f"element {place}: {error}") from None
        return tuple(values)

    return convert


def elements_of(raw: object) -> Elements:
    """Return the elements of a list, bytes or separated text."""
    if isinstance(raw, (list, tuple)):
        return raw
    if isinstance(raw, (bytes, bytearray)):
        return list(raw)
    if isinstance(raw, str):
        inner = raw.strip(_AROUND)
        return list(_BETWEEN.split(inner)) if inner else []
    raise BadValue(f"{quoted(raw)} is not a list")


def object_converter(raw: object) -> Reading:
    """Return a mapping or None unchanged; raise `BadValue` for any other value."""
    if raw is None or isinstance(raw, Mapping):
        return raw
    raise BadValue(f"{quoted(raw)} is not a mapping")


def bytes_converter(signal: Signal) -> Callable[[object], Reading]:
    """Return a function that checks raw bytes, or decodes base64 text or a ROS image to bytes."""
    most = signal.size or MAX_BYTES

    def convert(raw: object) -> Reading:
        if raw is None:
            return None
        is_message = isinstance(raw, Mapping) and signal.type == "image"
        data = picture_of(cast("Mapping[str, Any]", raw), bytes_of) if is_message else bytes_of(raw)
        if len(data) > most:
            raise BadValue(f"expected at most {most} bytes, found {len(data)}")
        if signal.type == "image" and pixels(data) > MAX_PIXELS:
            width, height = picture_size(data) or (0, 0)
            raise BadValue(
                f"an image of {width} by {height} pixels; the limit is {MAX_PIXELS} in total"
            )
        return data

    return convert


def video_converter(raw: object) -> Reading:
    """Return an access unit of a video unchanged; raise `BadValue` for other bytes."""
    if raw is None:
        return None
    data = bytes_of(raw)
    unit = read_unit(data)
    if unit is None:
        raise BadValue(f"{len(data)} bytes that are no access unit of a video")
    if unit.codec == JPEG:
        raise BadValue("the camera sends JPEG images; declare the signal as type: image")
    if unit.width * unit.height > MAX_PIXELS:
        raise BadValue(
            f"an image of {unit.width} by {unit.height} pixels; the limit is {MAX_PIXELS} in total"
        )
    return data


def bytes_of(raw: object) -> bytes:
    """Return bytes, base64 text or a list of numbers as bytes; raise `BadValue` for others."""
    if isinstance(raw, (bytes, bytearray, memoryview)):
        return bytes(raw)
    if isinstance(raw, str):
        return _from_base64(raw)
    if isinstance(raw, (list, tuple)):
        return _from_numbers(raw)
    raise BadValue(f"{quoted(raw)} is neither bytes nor base64")


def bytes_text(data: bytes) -> str:
    """Return bytes as base64 text."""
    return b2a_base64(data, newline=False).decode("ascii")


def _from_base64(text: str) -> bytes:
    try:
        return a2b_base64(text, strict_mode=True)
    except (Base64Error, ValueError):
        raise BadValue(f"{quoted(text)} is not base64") from None


def _from_numbers(numbers: list[object] | tuple[object, ...]) -> bytes:
    try:
        return bytes(numbers)  # type: ignore[arg-type]  # the handlers below check it
    except (TypeError, ValueError):
        raise BadValue(f"{quoted(numbers)} is not a list of bytes") from None
