"""Hints with known words for a misspelt word."""

import re
from collections.abc import Iterable
from typing import Final

__all__ = ["closest", "did_you_mean", "listed"]

_MOST: Final = 16
_SPARE: Final = 8
"""Number of words by which a list may exceed its maximum without being shortened."""


def did_you_mean(word: str, known: Iterable[str], noun: str = "") -> str:
    """Return a hint with the most similar known word, or with all known words if none is similar.

    Args:
        word: the unknown word.
        known: the known words.
        noun: plural noun for the known words, such as ``signals``.
    """
    names = sorted(known)
    bare = re.fullmatch(r"\{\{\s*([\w-]+)\s*\}\}", word)
    if bare and bare[1] in names:
        return f"write the name without braces: {bare[1]}"
    plain, slashes, comment = word.partition(" //")
    if slashes and plain.strip() in names:
        return f"start the comment with '#': {plain.strip()} # {comment.strip()}"
    near = closest(word, names)
    if near:
        return f"did you mean '{near[0]}'?"
    if not names:
        return f"there are no {noun} to choose from" if noun else ""
    return f"{noun or 'known'}: {listed(names, None if noun == 'keys' else _MOST)}"


def closest(word: str, names: Iterable[str]) -> list[str]:
    """Return the most similar name, or an empty list if none is similar."""
    from difflib import get_close_matches  # takes 6 ms, so only broken documents import it

    return get_close_matches(word[:80].lower(), sorted(names), 1, 0.6)


def listed(names: Iterable[str], most: int | None = _MOST) -> str:
    """Return the names, separated by commas; shorten a list with many more than `most`."""
    every = list(names)
    if most is None or len(every) <= most + _SPARE:
        return ", ".join(every)
    return f"{', '.join(every[:most])} and {len(every) - most} more"
