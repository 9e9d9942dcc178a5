"""Which known word a person may have meant."""

from collections.abc import Iterable

__all__ = ["did_you_mean", "listed"]


def did_you_mean(word: str, known: Iterable[str], noun: str = "") -> str:
    """Return a hint: the nearest known word, else all of them.

    Args:
        word: what was written.
        known: what could have been written.
        noun: what the known words are, in the plural: ``signals``.
    """
    from difflib import get_close_matches  # 6 ms that only a broken document pays

    names = sorted(known)
    near = get_close_matches(word[:80].lower(), names, 1, 0.6)
    if near:
        return f"did you mean '{near[0]}'?"
    if not names:
        return f"there are no {noun} here" if noun else ""
    return f"{noun or 'known'}: {listed(names)}"


def listed(names: Iterable[str], most: int = 16) -> str:
    """Return names with commas, cut after `most` of them."""
    every = list(names)
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + more
