"""Conversion between WebSocket frames and rosbridge operations, with size limits.

Pure. A frame is JSON text, or CBOR for subscriptions that request CBOR. An operation may arrive in
fragments, or as a PNG image with JSON text in its pixels. JSON has no NaN (not a number) and no
infinities, so the bridge writes null. This module also converts NaN and infinite values in CBOR
data to null.
"""

import base64
import binascii
import math
import struct
import zlib
from array import array
from collections.abc import Mapping
from typing import Any

import msgspec

__all__ = ["BadOperation", "OperationReader", "encode_operation"]

MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of an operation in any encoding, in bytes; the bridge's own limit is 10 MB."""
MAX_FRAGMENTED = 8
"""Maximum number of incomplete operations; beyond this limit, the oldest operation is dropped."""
MAX_FRAGMENTS = 4096
MAX_PNG_BYTES = 2 * 1024 * 1024
"""Maximum length of the text in an image, in bytes; decoding text of this length in Python takes
one second."""
MAX_VALUES = 2_000_000
"""Maximum number of commas and brackets in a frame; limited because an empty list takes three bytes
as text but fifty in memory."""
_MANY_VALUES = 100_000
"""Maximum number of values in a small CBOR frame, which may repeat values by reference. A larger
frame may contain as many values as bytes. Processing this many values takes a tenth of a second."""
_CBOR_MAP = b"\xa0"
"""First byte of a CBOR map; JSON text never begins with this byte or a higher byte."""
_LONGEST_ID = 256
_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_NUMBERS = {
    # RFC 8746: tags of number arrays, little-endian.
    69: "H", 70: "I", 71: "Q", 72: "b", 77: "h", 78: "i", 79: "q", 85: "f", 86: "d",
}  # fmt: skip

_WHOLE = frozenset("HIQbhiq")

_decode_json = msgspec.json.Decoder().decode
_encode_json = msgspec.json.Encoder().encode


class BadOperation(ValueError):
    """Raised for an invalid frame or operation, with a one-line error message."""


def encode_operation(operation: Mapping[str, object]) -> bytes:
    """Encode an operation as JSON; bytes become base64, and NaN values become null.

    Raises:
        BadOperation: a value cannot be written as JSON.
    """
    try:
        return _encode_json(operation)
    except (TypeError, ValueError, OverflowError) as problem:
        raise BadOperation(f"the value cannot be sent as JSON ({problem})") from problem


class OperationReader:
    """Decodes the frames of one connection, and joins fragmented operations."""

    def __init__(self, packed: frozenset[str] = frozenset()) -> None:
        """Create a reader; typed arrays of ``int8`` stay bytes in CBOR of the topics `packed`."""
        self._packed = packed
        self._halves: dict[str, dict[int, str]] = {}
        """Fragments of each incomplete operation, keyed by operation id and fragment number."""
        self._sizes: dict[str, int] = {}
        """Total number of characters in the fragments of each incomplete operation, keyed by
        operation id."""

    def read(self, frame: bytes) -> dict[str, Any] | None:
        """Return the operation in a frame, or None for an incomplete operation.

        Raises:
            BadOperation: the frame is invalid.
        """
        if frame[:1] >= _CBOR_MAP:
            return _operation(_read_cbor(frame, self._packed))
        operation = _read_json(frame)
        # At most two levels of nesting: fragments of a PNG.
        for _ in range(2):
            match operation.get("op"):
                case "fragment":
                    joined = self._join(operation)
                    if joined is None:
                        return None
                    operation = _read_json(joined)
                case "png":
                    operation = _read_json(_png_text(operation))
                case _:
                    break
        return operation

    def _join(self, piece: Mapping[str, Any]) -> str | None:
        name, number, total, data = (piece.get(key) for key in ("id", "num", "total", "data"))
        if not (isinstance(number, int) and isinstance(total, int) and isinstance(data, str)):
            raise BadOperation("a fragment has no number, total or data")
        if not 0 <= number < total <= MAX_FRAGMENTS:
            raise BadOperation(f"fragment {number} of {total} is invalid")
        key = str(name) if isinstance(name, str | int) else "?"
        if len(key) > _LONGEST_ID:
            raise BadOperation(f"the id of a fragment is too long ({len(key)} characters)")
        pieces = self._halves.setdefault(key, {})
        self._sizes[key] = self._sizes.get(key, 0) + len(data) - len(pieces.get(number, ""))
        pieces[number] = data
        if self._sizes[key] > MAX_BYTES:
            self._forget(key)
            raise BadOperation(f"the fragments of an operation exceed {MAX_BYTES} characters")
        if len(pieces) < total:
            while len(self._halves) > MAX_FRAGMENTED or sum(self._sizes.values()) > MAX_BYTES:
                self._forget(next(iter(self._halves)))
            return None
        self._forget(key)
        return "".join(pieces[place] for place in sorted(pieces))

    def _forget(self, key: str) -> None:
        del self._halves[key], self._sizes[key]


def _operation(found: object) -> dict[str, Any]:
    if not isinstance(found, dict) or not isinstance(found.get("op"), str):
        raise BadOperation("a frame has no operation")
    return found


def _read_json(text: bytes | str) -> dict[str, Any]:
    if len(text) > MAX_VALUES:
        flat = text.encode() if isinstance(text, str) else text
        if sum(map(flat.count, (b",", b"[", b"{"))) > MAX_VALUES:
            raise BadOperation(f"a frame has more than {MAX_VALUES} values")
    try:
        return _operation(_decode_json(text))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as problem:
        raise BadOperation(f"a frame is not JSON ({problem})") from problem


def _read_cbor(data: bytes, packed: frozenset[str]) -> object:
    import cbor2  # needed only for subscriptions with CBOR

    try:
        found = cbor2.loads(data, tag_hook=_tagged)
        topic = found.get("topic") if isinstance(found, dict) else None
        return _Plain(len(data), is_packed=isinstance(topic, str) and topic in packed).of(found)
    except (cbor2.CBORError, ValueError, RecursionError, MemoryError) as problem:
        raise BadOperation(f"a frame is not CBOR ({problem})") from problem


def _tagged(first: Any, second: Any) -> object:
    """Return a tagged array's numbers; since version 6, cbor2 passes the tag first."""
    tag = first if hasattr(first, "tag") else second
    code, data = _NUMBERS.get(tag.tag), tag.value
    if code is None or not isinstance(data, bytes) or len(data) % struct.calcsize(code):
        raise ValueError(f"the CBOR tag {tag.tag} is unknown")
    if code == "b":
        return _Signed(data)
    found = _Numbers if code in _WHOLE else list
    return found(struct.unpack(f"<{len(data) // struct.calcsize(code)}{code}", data))


class _Numbers(list[int]):
    """A typed array of integers, which needs no conversion: a map has a million of them."""


class _Signed:
    """A typed array of numbers from −128 to 127, not unpacked yet."""

    def __init__(self, data: bytes) -> None:
        self.data = data


class _Plain:
    """Converts CBOR values to JSON-like values, up to a maximum size of the result.

    References in CBOR data may be nested, so a few bytes could expand without limit.
    """

    def __init__(self, size: int, *, is_packed: bool = False) -> None:
        """Prepare the conversion of a frame of `size` bytes; each value takes at least one byte.

        If `is_packed`, arrays of ``int8`` stay bytes.
        """
        self._is_packed = is_packed
        self._room = MAX_BYTES
        """Remaining size of the result, in bytes; each value counts as at least one byte."""
        self._values = max(size, _MANY_VALUES)
        self._left = self._values
        """Remaining number of values that may be converted; the number is limited because even
        small values take time."""

    def of(self, value: Any) -> Any:
        """Return `value` with null in place of numbers that JSON cannot express."""
        if isinstance(value, _Signed):
            value = value.data if self._is_packed else _Numbers(array("b", value.data))
        self._room -= 1 + (len(value) if isinstance(value, str | bytes | _Numbers) else 0)
        if self._room < 0:
            raise ValueError(f"the frame expands to more than {MAX_BYTES} bytes")
        self._left -= 1 + (len(value) if isinstance(value, _Numbers) else 0)
        if self._left < 0:
            raise ValueError(f"the frame expands to more than {self._values} values")
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        if isinstance(value, _Numbers):
            return list(value)
        if isinstance(value, dict):
            return {_key(name): self.of(inner) for name, inner in value.items()}
        if isinstance(value, list):
            return [self.of(inner) for inner in value]
        if value is None or isinstance(value, bool | str | bytes):
            return value
        if isinstance(value, int) and value.bit_length() <= 64:
            return value
        raise ValueError(f"{type(value).__name__} cannot be a value in a message")


def _key(name: object) -> str:
    if not isinstance(name, str):
        raise ValueError(f"{type(name).__name__} is not a field name")
    return name


def _png_text(operation: Mapping[str, Any]) -> bytes:
    """Return the JSON text in a PNG image's pixels, without the newlines that pad it."""
    try:
        image = base64.b64decode(operation.get("data", ""), validate=True)
    except (binascii.Error, TypeError, ValueError) as problem:
        raise BadOperation(f"the png data is not base64 ({problem})") from problem
    return _pixels(image).rstrip(b"\n\x00")


def _pixels(image: bytes) -> bytes:
    """Return the pixel bytes of a non-interlaced 8-bit RGB image, the bridge's only format."""
    if not image.startswith(_PNG_MAGIC):
        raise BadOperation("the png data is not a PNG image")
    width = height = 0
    packed = bytearray()
    at = len(_PNG_MAGIC)
    while at + 8 <= len(image):
        length, kind = struct.unpack_from(">I4s", image, at)
        chunk = image[at + 8 : at + 8 + length]
        at += length + 12
        if kind == b"IHDR" and len(chunk) == 13:
            width, height, *form = struct.unpack(">IIBBBBB", chunk)
            if form != [8, 2, 0, 0, 0]:
                raise BadOperation("a PNG image must be 8-bit RGB")
        elif kind == b"IDAT":
            packed += chunk
    size = height * (width * 3 + 1)
    if not 0 < size <= MAX_PNG_BYTES:
        raise BadOperation(f"a png of {width} x {height} pixels is too large")
    try:
        rows = zlib.decompressobj().decompress(bytes(packed), size)
    except zlib.error as problem:
        raise BadOperation(f"a png cannot be unpacked ({problem})") from problem
    if len(rows) != size:
        raise BadOperation("a png ends too early")
    return _unfiltered(rows, width * 3)


def _unfiltered(rows: bytes, stride: int) -> bytes:
    """Reverse the filters of PNG rows; the first byte of each row selects the filter."""
    out = bytearray()
    above = bytes(stride)
    for start in range(0, len(rows), stride + 1):
        row = bytearray(rows[start + 1 : start + 1 + stride])
        match rows[start]:
            case 0:
                pass
            case 2:
                row = bytearray((x + up) & 255 for x, up in zip(row, above, strict=True))
            case 1 | 3 | 4 as kind:
                _undo_left(kind, row, above)
            case unknown:
                raise BadOperation(f"a png has the unknown filter {unknown}")
        out += row
        above = bytes(row)
    return bytes(out)


def _undo_left(kind: int, row: bytearray, above: bytes) -> None:
    """Reverse, in place, a PNG filter that uses the pixel to the left."""
    for place in range(len(row)):
        left = row[place - 3] if place >= 3 else 0
        up = above[place]
        if kind == 1:
            guess = left
        elif kind == 3:
            guess = (left + up) // 2
        else:
            corner = above[place - 3] if place >= 3 else 0
            by_left, by_up = abs(up - corner), abs(left - corner)
            by_corner = abs(left + up - 2 * corner)
            if by_left <= by_up and by_left <= by_corner:
                guess = left
            else:
                guess = up if by_up <= by_corner else corner
        row[place] = (row[place] + guess) & 255
