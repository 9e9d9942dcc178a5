"""Text for people, written in English and translated later.

A phrase stores the English text and the values, for later translation by `urc.web.words`.
`scripts.translations` collects the translatable text from calls to `phrase`.
"""

from collections.abc import Iterable, Mapping

__all__ = ["Phrase", "joined", "phrase"]


class Phrase(str):
    """Translatable English text."""

    __slots__ = ("between", "names", "pieces", "text")

    text: str
    """English text with a placeholder ``{name}`` for each of `names`."""
    names: Mapping[str, str]
    pieces: tuple[str, ...]
    """Phrases that a joined phrase consists of; the `text` of a joined phrase is empty."""
    between: str


def phrase(text: str, /, **names: object) -> Phrase:
    """Return a phrase; the values of placeholders may also be phrases."""
    said = {name: one if isinstance(one, str) else str(one) for name, one in names.items()}
    made = Phrase(text.format_map(said))
    made.text, made.names, made.pieces, made.between = text, said, (), ""
    return made


def joined(between: str, pieces: Iterable[str]) -> Phrase:
    """Return the concatenation of several phrases as one phrase."""
    some = tuple(pieces)
    made = Phrase(between.join(some))
    made.text, made.names, made.pieces, made.between = "", {}, some, between
    return made
