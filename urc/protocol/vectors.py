"""Values of many parts: arrays, objects, and bytes such as images.

Floor 3, pure. What comes in may be JSON-like data, bytes, or text: the elements of an array may
stand in text with blanks, commas or semicolons between them, and bytes may stand in text as base64.
Everything is bounded by the frame it came in.
"""

import re
from binascii import Error as Base64Error
from binascii import a2b_base64, b2a_base64
from collections.abc import Callable, Mapping

from urc.expressions import quoted
from urc.images import MAX_PIXELS, picture_size, pixels
from urc.model.values import Reading, Signal, Value
from urc.protocol.convert import BadValue

__all__ = ["MAX_BYTES", "MAX_ELEMENTS", "array_converter", "bytes_converter", "bytes_text"]
__all__ += ["elements_of", "object_converter"]

MAX_ELEMENTS = 65536
"""Elements of one array."""
MAX_BYTES = 1 << 24
"""Bytes of one image or blob that declares no ``size``."""
_BETWEEN = re.compile(r"[\s,;]+")
_AROUND = " \t\r\n[]()"


def array_converter(
    signal: Signal, element: Callable[[object], Value]
) -> Callable[[object], Reading]:
    """Return the function from raw elements to a tuple of values, each made by `element`."""
    wanted = signal.size

    def convert(raw: object) -> Reading:
        if raw is None:
            return None
        items = elements_of(raw)
        if wanted is not None and len(items) != wanted:
            raise BadValue(f"{len(items)} elements, {wanted} are expected")
        if len(items) > MAX_ELEMENTS:
            raise BadValue(f"{len(items)} elements, {MAX_ELEMENTS} are the most")
        values = []
        for place, item in enumerate(items):
            try:
                values.append(element(item))
            except BadValue as error:
                raise BadValue(f"element {place}: {error}") from None
        return tuple(values)

    return convert


def elements_of(raw: object) -> list[object] | tuple[object, ...]:
    """Return the elements in a list, in bytes, or in text between blanks, commas or semicolons."""
    if isinstance(raw, (list, tuple)):
        return raw
    if isinstance(raw, (bytes, bytearray)):
        return list(raw)
    if isinstance(raw, str):
        inner = raw.strip(_AROUND)
        return list(_BETWEEN.split(inner)) if inner else []
    raise BadValue(f"{quoted(raw)} is no list")


def object_converter(raw: object) -> Reading:
    """Return a mapping as it is."""
    if raw is None or isinstance(raw, Mapping):
        return raw
    raise BadValue(f"{quoted(raw)} has no named parts")


def bytes_converter(signal: Signal) -> Callable[[object], Reading]:
    """Return the function from raw bytes, or their base64, to bytes."""
    most = signal.size or MAX_BYTES

    def convert(raw: object) -> Reading:
        if raw is None:
            return None
        if isinstance(raw, (bytes, bytearray, memoryview)):
            data = bytes(raw)
        elif isinstance(raw, str):
            data = _from_base64(raw)
        elif isinstance(raw, (list, tuple)):
            data = _from_numbers(raw)
        else:
            raise BadValue(f"{quoted(raw)} is neither bytes nor their base64")
        if len(data) > most:
            raise BadValue(f"{len(data)} bytes, {most} are the most")
        if signal.type == "image" and pixels(data) > MAX_PIXELS:
            width, height = picture_size(data) or (0, 0)
            raise BadValue(f"a picture of {width} by {height} pixels; {MAX_PIXELS} are the most")
        return data

    return convert


def bytes_text(data: bytes) -> str:
    """Return bytes as base64."""
    return b2a_base64(data, newline=False).decode("ascii")


def _from_base64(text: str) -> bytes:
    try:
        return a2b_base64(text, strict_mode=True)
    except (Base64Error, ValueError):
        raise BadValue(f"{quoted(text)} is no base64") from None


def _from_numbers(numbers: list[object] | tuple[object, ...]) -> bytes:
    try:
        return bytes(numbers)  # type: ignore[arg-type]  # checked by what it raises
    except (TypeError, ValueError):
        raise BadValue(f"{quoted(numbers)} is no list of bytes") from None
