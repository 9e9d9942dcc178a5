"""Answers of several lines, as the emulated robot says them: with the mark that ends them.

Pure.
"""

from urc.patterns import Pattern, example
from urc.protocol.codec import BadText, Frame, Reader

__all__ = ["in_lines"]


def in_lines(
    payload: bytes, lines: int | Pattern | None, reader: Reader | None, encoding: str
) -> list[bytes]:
    """Return the frames of an answer.

    Args:
        payload: the whole answer, as its form writes it.
        lines: how many there are, or what the last one looks like; None: it is one frame.
        reader: of the whole answer.
        encoding: of the line.
    """
    if lines is None:
        return [payload]
    pieces = payload.split(b"\n")
    if isinstance(lines, int):
        return pieces + [b""] * (lines - len(pieces))
    if reader is None or _ends(pieces[-1], lines, encoding):
        return pieces
    end = example(lines, {}).encode(encoding, "replace")
    # What the form itself has in its last line may only stand there for the mark.
    choices = [[*pieces[:-1], end], [*pieces, end]] if len(pieces) > 1 else [[*pieces, end]]
    meant = _says(pieces, reader, encoding)
    said = [_says(one, reader, encoding) for one in choices]
    whole = [one for one, says in zip(choices, said, strict=True) if says == meant]
    read = [one for one, says in zip(choices, said, strict=True) if says is not None]
    return [*whole, *read, [*pieces, end]][0]


def _says(pieces: list[bytes], reader: Reader, encoding: str) -> dict[str, object] | None:
    """Return what lines say to whoever reads them: all but the names of the document itself."""
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
