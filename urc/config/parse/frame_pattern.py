"""Is a pattern fit to cut a stream? It must say by itself where a frame ends."""

from re import _constants, _parser  # type: ignore[attr-defined]  # no public door to the syntax tree
from typing import Any

from urc.config.part import Findings, Part

__all__ = ["check_frame_pattern"]

_REPEATS = (_constants.MAX_REPEAT, _constants.MIN_REPEAT)


def check_frame_pattern(part: Part, findings: Findings) -> None:
    """Report what keeps the pattern at `part`, which compiles, from cutting frames."""
    text: str = part.data
    far = next((place for place, char in enumerate(text) if ord(char) > 127), None)
    if far is not None:
        findings.error(
            part,
            "bad-pattern",
            f"{text[far]!r} is no byte: the pattern is over bytes, and sees no other characters",
            offset=far,
            hint="write its bytes as \\xHH",
        )
        return
    tree = _parser.parse(text.removeprefix("^"))
    if tree.getwidth()[0] == 0:
        findings.error(
            part,
            "matches-nothing",
            "the pattern also matches no bytes at all, which is no frame",
            hint="let it ask for at least one byte",
        )
    elif _has_anchor(tree):
        findings.error(
            part,
            "misplaced-anchor",
            "'^', '$' and '\\b' mean nothing inside a stream",
            hint="a frame begins where the pattern begins to match; name the bytes that end it",
        )
    elif _is_open(tree):
        findings.error(
            part,
            "open-end",
            "the pattern ends with something that may go on, so the end of a frame is never sure",
            hint=f"name what ends a frame, such as '{text}\\r\\n'",
        )


def _parts(operation: Any, argument: Any) -> list[Any]:
    """Return the sequences inside one node."""
    if operation is _constants.SUBPATTERN:
        return [argument[3]]
    if operation in _REPEATS:
        return [argument[2]]
    return list(argument[1]) if operation is _constants.BRANCH else []


def _has_anchor(tree: Any) -> bool:
    return any(
        operation is _constants.AT or any(map(_has_anchor, _parts(operation, argument)))
        for operation, argument in tree
    )


def _is_open(tree: Any) -> bool:
    """Return whether the last item of a sequence may take more or fewer bytes."""
    items = list(tree)
    if not items:
        return True
    operation, argument = items[-1]
    if operation in _REPEATS and argument[0] != argument[1]:
        return True
    return any(map(_is_open, _parts(operation, argument)))
