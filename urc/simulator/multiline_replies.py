"""Multiline replies from an emulated robot, including their last lines.

Pure.
"""

from urc.patterns import Pattern, example
from urc.protocol.values.payload import BadText, Frame, PayloadReader

__all__ = ["in_lines"]


def in_lines(
    payload: bytes, lines: int | Pattern | None, reader: PayloadReader | None, encoding: str
) -> list[bytes]:
    """Return the frames of a multiline reply.

    Args:
        payload: payload of the whole reply.
        lines: number of lines, or the pattern of the last line; None for a single-frame reply.
        reader: decoder for the whole reply.
        encoding: encoding of the transport.
    """
    if lines is None:
        return [payload]
    pieces = payload.split(b"\n")
    if isinstance(lines, int):
        return pieces + [b""] * (lines - len(pieces))
    if reader is None or _ends(pieces[-1], lines, encoding):
        return pieces
    end = example(lines, {}).encode(encoding, "replace")
    # The last line of the payload may be a placeholder for the end mark.
    choices = [[*pieces[:-1], end], [*pieces, end]] if len(pieces) > 1 else [[*pieces, end]]
    meant = _says(pieces, reader, encoding)
    said = [_says(one, reader, encoding) for one in choices]
    whole = [one for one, says in zip(choices, said, strict=True) if says == meant]
    read = [one for one, says in zip(choices, said, strict=True) if says is not None]
    return [*whole, *read, [*pieces, end]][0]


def _says(pieces: list[bytes], reader: PayloadReader, encoding: str) -> dict[str, object] | None:
    """Return the decoded fields of the lines, without internal fields."""
    try:
        found = reader.read(Frame(b"\n".join(pieces), encoding))
    except BadText:
        return None
    if found is None:
        return None
    return {name: raw for name, raw in found.items() if not name.startswith("_")}


def _ends(line: bytes, until: Pattern, encoding: str) -> bool:
    try:
        return until.search(Frame(line, encoding).text) is not None
    except BadText:
        return False
