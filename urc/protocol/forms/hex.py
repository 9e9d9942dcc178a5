"""The forms ``hex`` and ``bytes``: constant bytes and expressions."""

import re
from collections.abc import Callable, Mapping
from typing import Any, cast

from urc._number_codec import reader_of
from urc.expressions import Template, quoted
from urc.model.binary import number_of
from urc.model.payload import Payload, WriteSpec
from urc.protocol.values.payload import CodecContext, Frame, NotWritable

__all__ = ["BytesWriter"]

_PLAIN = re.compile(r"\s*([A-Za-z_][A-Za-z0-9_]*)\s*(?:\|\s*([a-z0-9]+)\s*)?")


class BytesWriter:
    """A writer that joins constants and values to bytes; it also reads fixed-width values back."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        self._pieces = cast("tuple[bytes | Template, ...]", spec.options["pieces"])
        self._encoding = context.encoding

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the frame; raise `NotWritable` or `ExpressionError`."""
        return b"".join(
            [one if isinstance(one, bytes) else self._bytes(one, namespace) for one in self._pieces]
        )

    def _bytes(self, template: Template, namespace: Mapping[str, object]) -> bytes:
        value = template.evaluate(namespace)
        if isinstance(value, bytes):
            return value
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, int):
            if 0 <= value <= 255:
                return bytes((value,))
            raise NotWritable(
                f"{template.source.strip()}: expected a byte, 0 to 255, found {value}"
            )
        if isinstance(value, str):
            try:
                return value.encode(self._encoding)
            except UnicodeEncodeError as error:
                wrong = error.object[error.start]
                raise NotWritable(
                    f"{quoted(wrong)} cannot be encoded in {self._encoding}"
                ) from None
        raise NotWritable(
            f"{template.source.strip()}: {str(value)[:40]} is neither a byte nor text"
        )

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values of pieces such as ``{{ name | u16be }}``; None if they do not match."""
        data, at = frame.payload, 0
        if not isinstance(data, bytes):
            return None
        found: dict[str, Any] = {}
        for place, piece in enumerate(self._pieces):
            if isinstance(piece, bytes):
                if not data.startswith(piece, at):
                    return None
                at += len(piece)
                continue
            plain = _PLAIN.fullmatch(piece.source)
            name, word = (plain[1], plain[2] or "") if plain else ("", "")
            number = number_of(_word_of(piece.source))
            raw: Any = None
            if number is None:
                after = self._end(data, at, place)
            else:
                try:
                    raw, after = reader_of(number, ValueError)(data, at, len(data))
                except ValueError:
                    return None
            if after < 0 or after > len(data):
                return None
            if name and number is not None:
                found[name] = raw
            elif name and word in _WORDS:
                found[name] = _WORDS[word](data[at:after])
            at = after
        return found if at == len(data) else None

    def _end(self, data: bytes, at: int, place: int) -> int:
        """Return the end of a variable-size piece: the next constant, or the end of the data."""
        for piece in self._pieces[place + 1 :]:
            if isinstance(piece, bytes):
                return data.find(piece, at)
        return len(data)


def _word_of(source: str) -> str:
    """Return the last filter in an expression, such as ``u16be``."""
    return source.rpartition("|")[2].strip()


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _hex(data: bytes) -> str:
    return data.hex()


_WORDS: dict[str, Callable[[bytes], str]] = {"hexbytes": _hex, "utf8": _text}
