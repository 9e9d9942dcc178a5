"""What an answer repeats of its request, and what a frame must say to be the one that is meant.

Pure. Works on the equalities and lists of constants in ``when`` and ``match``: nothing else in an
expression can be turned round.
"""

import re
from collections.abc import Iterator, Mapping

from urc.expressions import Template
from urc.model.codec import ReadSpec
from urc.model.driver import Argument

__all__ = ["correlated", "own_fields", "typed_arguments"]

_EQUALS = re.compile(
    r"""(?<![\w.])(_?[A-Za-z]\w*(?:\.\w+)?)\s*==\s*
    ('[^'\\]*'|"[^"\\]*"|-?\d+(?:\.\d+)?(?![\w.])|_?[A-Za-z]\w*(?:\.\w+)?)(?!\w)""",
    re.VERBOSE | re.ASCII,
)
_ONE_OF = re.compile(
    r"""(?<![\w.])(_?[A-Za-z]\w*)\s+in\s+[\[(]\s*('[^'\\]*'|"[^"\\]*"|-?\d+(?:\.\d+)?)\s*[,\])]""",
    re.ASCII,
)
"""A name, and the first of the constants that it may be."""


def own_fields(spec: ReadSpec, known: Mapping[str, object]) -> dict[str, object]:
    """Return the fields that are the document's own: constants, and echoes of the request."""
    own: dict[str, object] = {}
    if spec.when is not None:
        for left, right in _equalities(spec.when):
            if left in spec.fields and not isinstance(right, _Name):
                own[left] = right
    wanted = {name for one in spec.sets.values() for name in one.names if len(one.names) > 1}
    for name in spec.fields:
        if not name.startswith("_") or name in own:
            continue
        echoed = known.get(name, known.get(name[1:]))
        if echoed is not None:
            own[name] = echoed
        elif name in wanted:
            own[name] = 1
    return own


class _Name(str):
    """A name in an equality, in contrast to a text."""

    __slots__ = ()


def _equalities(template: Template) -> Iterator[tuple[str, object]]:
    """Yield (name, constant or name) for each ``name == …`` and ``name in […]``."""
    for found in _EQUALS.finditer(template.source):
        left, right = found[1], found[2]
        if right[0].isalpha() or right[0] == "_":
            yield left, _Name(right)
            yield right, _Name(left)
        else:
            yield left, _constant(right)
    for found in _ONE_OF.finditer(template.source):
        yield found[1], _constant(found[2])


def _constant(text: str) -> object:
    if text[0] in "'\"":
        return text[1:-1]
    return float(text) if "." in text else int(text)


def correlated(match: Template, known: Mapping[str, object]) -> dict[str, object]:
    """Return the reply's fields that must repeat something of the request, or are constants."""
    return {
        left: known[right] if isinstance(right, _Name) else right
        for left, right in _equalities(match)
        if not isinstance(right, _Name) or right in known
    }


def typed_arguments(
    found: Mapping[str, object], arguments: Mapping[str, Argument]
) -> dict[str, object] | None:
    """Return the arguments in a frame with their types, or None when they are not of them."""
    typed: dict[str, object] = {}
    for name, raw in found.items():
        argument = arguments.get(name)
        try:
            typed[name] = _as(argument.type if argument else "", raw)
        except ValueError:
            return None
    return typed


def _as(kind: str, raw: object) -> object:
    if not isinstance(raw, str) or kind == "string":
        return raw
    if kind == "integer":
        return int(raw)
    if kind == "number":
        return float(raw)
    if kind == "boolean":
        if raw.lower() not in ("true", "false", "1", "0", "on", "off"):
            raise ValueError(raw)
        return raw.lower() in ("true", "1", "on")
    return int(raw) if raw.isdecimal() and str(int(raw)) == raw else raw
