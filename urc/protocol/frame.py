"""Conversion between a payload and its frame, according to the frame layout.

Pure. A `Seal` implements one layout. The framings only find the frames in the stream.
"""

import binascii
from typing import Literal

from urc.model.framing import Digits, FrameLayout, LengthSpec
from urc.protocol.checksums import BadFrame, Checksum
from urc.protocol.open_source import generate_open
from urc.protocol.spelt_length import SpeltLength
from urc.protocol.stuffing import Stuffing
from urc.protocol.trail import Trail

__all__ = ["BadFrame", "LengthField", "Seal", "length_of"]


class Seal:
    """Wraps and unwraps payloads: constants, length field and checksum."""

    def __init__(self, layout: FrameLayout) -> None:
        self.layout = layout
        self.length = length_of(layout.length) if layout.length else None
        self._loose = self.length if isinstance(self.length, SpeltLength) else None
        specs = (*layout.checksums, *((layout.checksum,) if layout.checksum else ()))
        self._checksums = tuple(Checksum(one) for one in specs)
        self._stuffing = Stuffing(layout.escape) if layout.escape else None
        self._trail = Trail(layout.trail, layout.start) if layout.trail else None
        self._is_text = layout.trail is not None or layout.digits != ""
        is_plain = (
            not layout.checksums
            and layout.escape is None
            and self._loose is None
            and not self._is_text
        )
        self.open = generate_open(layout, self._open) if is_plain else self._open
        """Frame → payload; raises `BadFrame` for a wrong or missing checksum."""

    def _open(self, frame: bytes) -> bytes:
        """Return the payload; raise `BadFrame` for a wrong or missing checksum."""
        if self._is_text:
            frame = self._read(frame)
        for checksum in self._checksums:
            checksum.check(frame)
        head, stop = self.layout.head, len(frame) - self.layout.tail
        if self._loose is not None:
            head = self._loose.head(frame)
        if stop < head:
            raise BadFrame("short-frame", f"{len(frame)} bytes are too few for this kind of frame")
        payload = frame[head:stop]
        return payload if self._stuffing is None else self._stuffing.unstuff(payload)

    def close(self, payload: bytes) -> bytes:
        """Return the frame around `payload`; raise `BadFrame` if the payload does not fit.

        Bytes outside the payload and the fields of the layout are zeros.
        """
        layout = self.layout
        if self._stuffing is not None:
            payload = self._stuffing.stuff(payload)
        head = bytes(layout.head)
        if self._loose is not None:
            head += self._loose.before(payload, layout.tail)
        frame = bytearray(head) + payload + bytes(layout.tail)
        if layout.size is not None and len(frame) != layout.size:
            wanted = layout.size - layout.head - layout.tail
            raise BadFrame(
                "wrong-size", f"expected {wanted} bytes of payload, found {len(payload)}"
            )
        start, end = layout.start, layout.end
        if start:
            frame[: len(start)] = start
        if end:
            frame[len(frame) - len(end) :] = end
        if isinstance(self.length, LengthField):
            self.length.put(frame, len(frame) - layout.tail)
        for checksum in self._checksums:
            checksum.put(frame)
        return self._spelt(bytes(frame)) if self._is_text else bytes(frame)

    def _read(self, frame: bytes) -> bytes:
        """Return the frame without its trailing checksum and with its digits decoded."""
        start, end = self.layout.start, self.layout.end
        if len(frame) < len(start) + len(end):
            raise BadFrame("short-frame", f"{len(frame)} bytes are too few for this kind of frame")
        content = frame[len(start) : len(frame) - len(end)]
        if self._trail is not None:
            content = self._trail.take_off(content)
        return start + _bytes_of(content, self.layout.digits) + end

    def _spelt(self, frame: bytes) -> bytes:
        """Return the frame in its wire form; the inverse of `_read`."""
        start, end = self.layout.start, self.layout.end
        content = _digits_of(frame[len(start) : len(frame) - len(end)], self.layout.digits)
        if self._trail is not None:
            content = self._trail.put_on(content)
        return start + content + end


def _bytes_of(text: bytes, digits: Digits) -> bytes:
    if not digits:
        return text
    try:
        if digits == "base64":
            return binascii.a2b_base64(text, strict_mode=True) if text else b""
        return binascii.unhexlify(text)
    except binascii.Error:
        noun = "base64" if digits == "base64" else "pairs of hex digits"
        shown = ascii(text[:40].decode("latin-1"))
        raise BadFrame("bad-digits", f"expected {noun} in the frame, found {shown}") from None


def _digits_of(data: bytes, digits: Digits) -> bytes:
    if digits == "base64":
        return binascii.b2a_base64(data, newline=False)
    if digits:
        text = data.hex().encode()
        return text if digits == "hex" else text.upper()
    return data


def length_of(spec: LengthSpec) -> "LengthField | SpeltLength":
    """Return the length field for `spec`."""
    return SpeltLength(spec) if spec.is_loose else LengthField(spec)


class LengthField:
    """The length field of a frame."""

    def __init__(self, spec: LengthSpec) -> None:
        self._spec = spec
        self.end = max(spec.offset + spec.size, spec.flag_at + 1)
        """Number of frame bytes needed to read it."""
        self._mask = (1 << min(spec.bits, 8 * spec.size)) - 1

    def total(self, data: bytes | bytearray, at: int) -> int:
        """Return the size of the frame at `at`, in bytes; negative for an invalid length field."""
        spec = self._spec
        if spec.flag_at >= 0 and not data[at + spec.flag_at] & spec.flag_mask:
            return spec.adjust
        field = data[at + spec.offset : at + spec.offset + spec.size]
        if spec.spelling == "raw":
            number = int.from_bytes(field, "big" if spec.is_big else "little") & self._mask
        else:
            base = 10 if spec.spelling == "dec" else 16
            if not field.isalnum():
                return -1
            try:
                number = int(field, base)
            except ValueError:
                return -1
        return number * spec.unit + spec.adjust

    def put(self, frame: bytearray, stop: int) -> None:
        """Write the size of `frame` into it, before the place `stop`.

        Raises:
            BadFrame: the field has no room, or cannot represent the size.
        """
        spec = self._spec
        number, left = divmod(len(frame) - spec.adjust, spec.unit)
        place = slice(spec.offset, spec.offset + spec.size)
        if self.end <= stop and spec.flag_at >= 0 and not frame[spec.flag_at] & spec.flag_mask:
            if number or left:
                text = f"a frame without the flag has {spec.adjust} bytes, found {len(frame)}"
                raise BadFrame("wrong-size", text)
            return  # the bytes there belong to the payload
        if left:
            raise BadFrame("wrong-size", f"the frame is counted in {spec.unit} bytes; {left} over")
        if self.end > stop or number < 0:
            raise BadFrame("wrong-size", f"{len(frame)} bytes are too few for this kind of frame")
        if spec.spelling == "raw":
            if number > self._mask:
                raise BadFrame("wrong-size", f"the length field cannot hold {number}")
            order: Literal["big", "little"] = "big" if spec.is_big else "little"
            kept = int.from_bytes(frame[place], order) & ~self._mask
            frame[place] = (kept | number).to_bytes(spec.size, order)
            return
        form = b"%0*d" if spec.spelling == "dec" else b"%0*x"
        digits = form % (spec.size, number)
        if len(digits) > spec.size:
            raise BadFrame("wrong-size", f"the length field cannot hold {number}")
        frame[place] = digits.upper() if spec.spelling == "HEX" else digits
