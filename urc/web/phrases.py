"""Says phrases of lower floors in the reader's language.

Floor 5. Pure.
"""

from urc._phrases import Phrase
from urc.web.words import t

__all__ = ["spoken"]


def spoken(line: str) -> str:
    """Return a line in the current language; what is no phrase stays as it is."""
    if not isinstance(line, Phrase):
        return line
    if line.pieces:
        return line.between.join(map(spoken, line.pieces))
    return t(line.text, **{name: spoken(one) for name, one in line.names.items()})
