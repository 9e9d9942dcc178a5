"""Zenoh keys and key expressions: their rules, and which keys an expression matches.

Pure. A key is one or more chunks, separated by ``/``. In a key expression, ``*`` is any one chunk,
``**`` is any number of chunks, and ``$*`` is any text within a chunk. A chunk that begins with
``@`` matches only the same chunk. Source: the key expressions of the Zenoh protocol.
"""

from collections.abc import Callable
from itertools import pairwise

__all__ = ["is_key_expression", "key_fault", "key_matches"]

_MOST = 65_535
"""Maximum length of a key on the wire, in bytes."""


def key_fault(key: str, *, is_expression: bool = False) -> str:
    """Return why `key` is not a key, or not a key expression; "" if it is one."""
    if not key or len(key.encode("utf-8", "surrogatepass")) > _MOST:
        return f"it needs 1 to {_MOST} bytes"
    for sign in ("#", "?", "\0"):
        if sign in key:
            return f"{sign!r} is not allowed"
    chunks = key.split("/")
    if "" in chunks:
        return "it has an empty part: a '/' at an end, or two in a row"
    if not is_expression:
        return next((f"{sign!r} is not allowed" for sign in ("*", "$") if sign in key), "")
    for chunk in chunks:
        rest = chunk.replace("$*", "")
        if chunk not in ("*", "**") and ("*" in rest or "$" in rest):
            return f"{chunk!r} must be *, ** or text with $*"
        if chunk == "$*" or "$*$*" in chunk:
            return f"{chunk!r} must be written as * or with one $*"
    for one, other in pairwise(chunks):
        if one == "**" and other in ("*", "**"):
            right = "**" if other == "**" else "*/**"
            return f"'{one}/{other}' must be written as '{right}'"
    return ""


def is_key_expression(key: str) -> bool:
    """Return whether `key` contains a wildcard."""
    return "*" in key


def key_matches(expression: str) -> Callable[[str], bool]:
    """Return a function that checks whether a key matches `expression`."""
    if not is_key_expression(expression):
        return lambda key: key == expression
    chunks = expression.split("/")
    return lambda key: _fits(chunks, key.split("/"))


def _fits(chunks: list[str], key: list[str]) -> bool:
    """Return whether the chunks of a key match; the time is proportional to their product."""
    reached = {0}  # numbers of matched chunks of the expression
    for word in (*key, None):
        for at in range(len(chunks)):
            if at in reached and chunks[at] == "**":
                reached.add(at + 1)  # "**" also matches nothing
        if word is None:
            break
        passed = set()
        for at in reached:
            if at == len(chunks):
                continue
            if chunks[at] == "**" and not word.startswith("@"):
                passed.add(at)
            elif _chunk_fits(chunks[at], word):
                passed.add(at + 1)
        reached = passed
    return len(chunks) in reached


def _chunk_fits(chunk: str, word: str) -> bool:
    if chunk == word:
        return True
    if word.startswith("@") or chunk.startswith("@") or "*" not in chunk:
        return False
    if chunk == "*":
        return True
    first, *middle, last = chunk.split("$*")
    if len(word) < len(first) + len(last) or not word.startswith(first):
        return False
    place, end = len(first), len(word) - len(last)
    for part in middle:
        found = word.find(part, place, end)
        if found < 0:
            return False
        place = found + len(part)
    return word.endswith(last)
