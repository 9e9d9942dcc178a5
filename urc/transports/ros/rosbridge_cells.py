"""Cells of occupancy grids as bytes, cut out of rosbridge's JSON text.

A map in JSON has up to millions of numbers. Decoding them at once would hold up the event loop,
which in the guard also writes stops. The cells are therefore cut out of the text and decoded in
small pieces, between which other tasks run. The rest of the message is small. The cells are then
passed on as bytes, as over foxglove_bridge, so no process handles a list of a million numbers.

Only frames of topics whose cells the driver reads as bytes are treated in this way. A frame that
does not have the expected form is left to `OperationReader`.
"""

import asyncio
import re
from array import array
from typing import Any, Final

import msgspec

__all__ = ["LARGE_BYTES", "packed_operation"]

LARGE_BYTES: Final = 32_768
"""Minimum size of a frame from which the cells are decoded in pieces."""
_PIECE_BYTES: Final = 16_384
"""Length of a piece; decoding a piece takes about one millisecond."""
_CUT: Final = "cells"
"""Text in place of the cells in the rest of the frame."""
_START: Final = re.compile(rb'"data"\s*:\s*\[')

_decode_rest = msgspec.json.Decoder().decode
_decode_numbers = msgspec.json.Decoder(list[int]).decode


async def packed_operation(frame: bytes, topics: frozenset[str]) -> dict[str, Any] | None:
    """Return the operation of a frame, with its cells as bytes; None if the frame has another form.

    Args:
        frame: JSON text.
        topics: topics whose cells are wanted as bytes.
    """
    start = _START.search(frame)
    end = -1 if start is None else frame.find(b"]", start.end())
    if start is None or end < 0:
        return None
    rest = b'%s"%s"%s' % (frame[: start.end() - 1], _CUT.encode(), frame[end + 1 :])
    if len(rest) > LARGE_BYTES:
        return None
    try:
        operation = _decode_rest(rest)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None
    if not isinstance(operation, dict) or operation.get("op") != "publish":
        return None
    topic, message = operation.get("topic"), operation.get("msg")
    if not isinstance(topic, str) or topic not in topics or not isinstance(message, dict):
        return None
    if message.get("data") != _CUT:
        return None
    cells = await _cells(frame, start.end(), end)
    if cells is None:
        return None
    message["data"] = cells
    return operation


async def _cells(frame: bytes, at: int, end: int) -> bytes | None:
    """Return the numbers from `at` to `end` as bytes; None unless all are from −128 to 127."""
    cells = bytearray()
    while at < end:
        comma = frame.find(b",", min(at + _PIECE_BYTES, end), end)
        stop = end if comma < 0 else comma
        if stop - at > 2 * _PIECE_BYTES:
            return None  # a number, or white space, of many thousand letters
        try:
            cells += array("b", _decode_numbers(b"[%s]" % frame[at:stop])).tobytes()
        except (msgspec.DecodeError, OverflowError, UnicodeDecodeError):
            return None
        at = stop + 1
        await asyncio.sleep(0)
    return bytes(cells)
