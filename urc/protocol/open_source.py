"""Generated frame decoders: one function per layout checks the checksum and cuts out the payload.

Pure. They support the layouts of most protocols: a raw checksum of 8, 16 or 32 bits near the end,
over the bytes before it. The general decoder handles all other layouts and every invalid frame, and
reports the error; tests compare the two.
"""

import binascii
from collections.abc import Callable
from typing import Final

from urc._sums import build_algorithm
from urc.model.framing import ChecksumSpec, CrcSpec, FrameLayout, Salt
from urc.protocol.generate import function_of

__all__ = ["generate_open"]

Open = Callable[[bytes], bytes]

_CCITT: Final = {CrcSpec(16, 0x1021): 0, CrcSpec(16, 0x1021, 0xFFFF): 0xFFFF}
"""Checksums with a direct function in the standard library → start value."""


def generate_open(layout: FrameLayout, slow: Open) -> Open:
    """Return the function from a frame to its payload; `slow` is the general decoder."""
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
