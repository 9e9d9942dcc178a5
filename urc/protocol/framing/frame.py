"""Conversion of payloads to frames and back, according to a frame layout.

Pure. A `FrameCodec` implements one layout. The framings find the frames in the stream and use the
codec to convert each frame.
"""

import binascii
from collections.abc import Callable
from typing import Final, Literal

from urc._checksum_math import build_algorithm
from urc.model.framing import ChecksumSpec, CrcSpec, Digits, FrameLayout, LengthSpec, Salt
from urc.protocol.compile.source import function_of
from urc.protocol.framing.checksum_trailer import ChecksumTrailer
from urc.protocol.framing.checksums import BadFrame, Checksum
from urc.protocol.framing.digit_length import DigitLength
from urc.protocol.framing.stuffing import Stuffing

__all__ = ["BadFrame", "LengthField", "FrameCodec", "length_of"]


Open = Callable[[bytes], bytes]

_CCITT: Final = {CrcSpec(16, 0x1021): 0, CrcSpec(16, 0x1021, 0xFFFF): 0xFFFF}
"""Initial values of those CRCs that the standard library can compute, keyed by CRC parameters."""


def generate_open(layout: FrameLayout, slow: Open) -> Open:
    """Return a function that decodes a frame to its payload, and calls `slow` in uncommon cases."""
    spec = layout.checksum
    if spec is not None and not _is_common(spec):
        return slow
    scope: dict[str, object] = {"slow": slow, "len": len, "int": int}
    least = layout.head + layout.tail
    payload = f"frame[{layout.head}:{-layout.tail or ''}]"
    lines = []
    if spec is not None and spec.over.stop is not None:
        least = max(least, spec.over.start - spec.over.stop, -spec.at)
        window = f"frame[{spec.over.start or ''}:{spec.over.stop}]"
        is_payload = (spec.over.start, -spec.over.stop) == (layout.head, layout.tail)
        lines.append(f"    data = {window}")
        lines.append(f"    if {_computed(spec, scope)} != {_found(spec)}: return slow(frame)")
        payload = "data" if is_payload else payload
    check = f"    if len(frame) < {least}: return slow(frame)"
    return function_of("open_frame", "frame", [check, *lines, f"    return {payload}"], scope)


def _is_common(spec: ChecksumSpec) -> bool:
    stop = spec.over.stop
    is_before = stop is not None and stop <= spec.at < 0 <= spec.over.start
    return (
        is_before
        and spec.spelling == "raw"
        and spec.bits in (8, 16, 32)
        and spec.salt == Salt()
        and not spec.before
    )


def _computed(spec: ChecksumSpec, scope: dict[str, object]) -> str:
    if isinstance(spec.algorithm, CrcSpec) and spec.algorithm in _CCITT:
        scope["crc_hqx"] = binascii.crc_hqx
        return f"crc_hqx(data, {_CCITT[spec.algorithm]})"
    scope["compute"] = build_algorithm(spec.algorithm, is_big=spec.is_big)
    return "compute(data)"


def _found(spec: ChecksumSpec) -> str:
    at = spec.at
    if spec.size == 1:
        return f"frame[{at}]"
    if spec.size == 2:
        high, low = (at, at + 1) if spec.is_big else (at + 1, at)
        return f"(frame[{high}] << 8 | frame[{low}])"
    end = "" if at == -spec.size else at + spec.size
    return f"int.from_bytes(frame[{at}:{end}], {'big' if spec.is_big else 'little'!r})"


class FrameCodec:
    """A converter between payloads and frames with constants, a length field and a checksum."""

    def __init__(self, layout: FrameLayout) -> None:
        self.layout = layout
        self.length = length_of(layout.length) if layout.length else None
        self._loose = self.length if isinstance(self.length, DigitLength) else None
        specs = (*layout.checksums, *((layout.checksum,) if layout.checksum else ()))
        self._checksums = tuple(Checksum(one) for one in specs)
        self._stuffing = Stuffing(layout.escape) if layout.escape else None
        self._trailer = ChecksumTrailer(layout.trailer, layout.start) if layout.trailer else None
        self._is_text = layout.trailer is not None or layout.digits != ""
        is_plain = (
            not layout.checksums
            and layout.escape is None
            and self._loose is None
            and not self._is_text
        )
        self.open = generate_open(layout, self._open) if is_plain else self._open
        """Function that returns a frame's payload, or raises `BadFrame` for an invalid frame."""

    def _open(self, frame: bytes) -> bytes:
        """Return the payload of a frame; raise `BadFrame` for an invalid frame."""
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
        """Return `payload` as a frame; raise `BadFrame` if the payload does not fit.

        Bytes of the layout that neither the payload nor a declared part fills are zero.
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
            self.length.write(frame, len(frame) - layout.tail)
        for checksum in self._checksums:
            checksum.write(frame)
        return self._spelt(bytes(frame)) if self._is_text else bytes(frame)

    def _read(self, frame: bytes) -> bytes:
        """Return a received frame with its checksum trailer removed and its digits decoded."""
        start, end = self.layout.start, self.layout.end
        if len(frame) < len(start) + len(end):
            raise BadFrame("short-frame", f"{len(frame)} bytes are too few for this kind of frame")
        content = frame[len(start) : len(frame) - len(end)]
        if self._trailer is not None:
            content = self._trailer.take_off(content)
        return start + _bytes_of(content, self.layout.digits) + end

    def _spelt(self, frame: bytes) -> bytes:
        """Return the frame in wire form; this function is the inverse of `_read`."""
        start, end = self.layout.start, self.layout.end
        content = _digits_of(frame[len(start) : len(frame) - len(end)], self.layout.digits)
        if self._trailer is not None:
            content = self._trailer.put_on(content)
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


def length_of(spec: LengthSpec) -> "LengthField | DigitLength":
    """Return the length field that `spec` declares, of fixed or variable size."""
    return DigitLength(spec) if spec.is_loose else LengthField(spec)


class LengthField:
    """A length field of fixed size."""

    def __init__(self, spec: LengthSpec) -> None:
        self._spec = spec
        self.end = max(spec.offset + spec.size, spec.flag_at + 1)
        """Number of frame bytes that must be received before the length field can be read."""
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

    def write(self, frame: bytearray, stop: int) -> None:
        """Write the size of `frame` into its length field, which must end by offset `stop`.

        Raises:
            BadFrame: the length field does not fit or cannot represent the size.
        """
        spec = self._spec
        number, left = divmod(len(frame) - spec.adjust, spec.unit)
        place = slice(spec.offset, spec.offset + spec.size)
        if self.end <= stop and spec.flag_at >= 0 and not frame[spec.flag_at] & spec.flag_mask:
            if number or left:
                text = f"expected {spec.adjust} bytes if the flag is unset, found {len(frame)}"
                raise BadFrame("wrong-size", text)
            return  # the bytes there belong to the payload
        if left:
            raise BadFrame(
                "wrong-size",
                f"the frame's size must be a multiple of {spec.unit} bytes; {left} left over",
            )
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
