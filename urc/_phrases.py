"""Lines for people that can still be said in another language.

A phrase is its English text, and remembers what it is made of: who has a catalogue says it anew,
see `urc.web.words`. `scripts.translations` finds the texts by the name of `phrase`.
"""

from collections.abc import Iterable, Mapping

__all__ = ["Phrase", "joined", "phrase"]


class Phrase(str):
    """A line in English."""

    __slots__ = ("between", "names", "pieces", "text")

    text: str
    """With ``{name}`` for each of `names`."""
    names: Mapping[str, str]
    pieces: tuple[str, ...]
    """What it is put together of, where it has no text of its own."""
    between: str


def phrase(text: str, /, **names: object) -> Phrase:
    """Return a line; what stands in a hole may be a phrase, too."""
    said = {name: one if isinstance(one, str) else str(one) for name, one in names.items()}
    made = Phrase(text.format_map(said))
    made.text, made.names, made.pieces, made.between = text, said, (), ""
    return made


def joined(between: str, pieces: Iterable[str]) -> Phrase:
    """Return phrases as one."""
    some = tuple(pieces)
    made = Phrase(between.join(some))
    made.text, made.names, made.pieces, made.between = "", {}, some, between
    return made
