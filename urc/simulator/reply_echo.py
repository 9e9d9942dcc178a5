"""Reply fields that repeat values from the request, and fields that identify a frame.

Pure. The module inverts only equalities, lists of constants and pattern tests in ``when`` and
``match``.
"""

import re
from collections.abc import Iterator, Mapping

from urc.expressions import Template
from urc.model.driver import Argument, Driver
from urc.model.payload import Envelope, Payload, ReadSpec
from urc.patterns import compile_pattern, example
from urc.protocol.values.vectors import elements_of

__all__ = ["correlated", "own_fields", "rule_for", "typed_arguments"]

_EQUALS = re.compile(
    r"""(?<![\w.])(_?[A-Za-z]\w*(?:\.\w+)?)\s*==\s*
    ('[^'\\]*'|"[^"\\]*"|0x[0-9A-Fa-f]+|-?\d+(?:\.\d+)?(?![\w.])|_?[A-Za-z]\w*(?:\.\w+)?)(?!\w)""",
    re.VERBOSE | re.ASCII,
)
_ONE_OF = re.compile(
    r"""(?<![\w.])(_?[A-Za-z]\w*)\s+in\s+[\[(]\s*
    ('[^'\\]*'|"[^"\\]*"|0x[0-9A-Fa-f]+|-?\d+(?:\.\d+)?)\s*[,\])]""",
    re.VERBOSE | re.ASCII,
)
"""Pattern for ``name in [constant, …]``, with groups for the name and the first constant."""


_MATCH = re.compile(
    r"(?<![\w.])(_?[A-Za-z]\w*)\s+is\s+(?:match|search)\(\s*'([^']*)'\s*\)", re.ASCII
)
"""Pattern for ``name is match('…')``, with groups for the name and the regular expression."""


_HEMISPHERE = re.compile(r"\|\s*ddmm\(\s*(_?[A-Za-z]\w*)\s*\)", re.ASCII)
"""Pattern for the filter ``ddmm``, with a group for the name of the hemisphere field."""


def rule_for(driver: Driver, transport: str, label: str) -> str:
    """Return a suggested simulator rule for a request without an automatic reply."""
    if label in driver.commands and not driver.commands[label].steps:
        trigger = f"command: {label}"
    elif any(label == poll.name != f"polls.{at}" for at, poll in enumerate(driver.polls)):
        trigger = f"poll: {label}"
    else:
        trigger = "match: …"
    return f"write simulator: {{ {transport}: [{{ {trigger}, send: … }}] }}"


def own_fields(spec: ReadSpec, known: Mapping[str, object]) -> dict[str, object]:
    """Return the document's internal fields: constants, and values repeated from the request."""
    own: dict[str, object] = {}
    if spec.when is not None:
        for left, right in _equalities(spec.when):
            if left in spec.fields and not isinstance(right, _Name):
                own[left] = right
    sources = [one.source for one in spec.sets.values()]
    hemispheres = {found for source in sources for found in _HEMISPHERE.findall(source)}
    wanted = {name for one in spec.sets.values() for name in one.names if len(one.names) > 1}
    for name in spec.fields:
        if not name.startswith("_") or name in own:
            continue
        echoed = known.get(name, known.get(name[1:]))
        if echoed is not None:
            own[name] = echoed
        elif name in hemispheres:
            own[name] = "N"
        elif name in wanted:
            own[name] = 1
    return own


class _Name(str):
    """A name in an equality, as opposed to a text constant."""

    __slots__ = ()


def _equalities(template: Template) -> Iterator[tuple[str, object]]:
    """Yield each name with a constant or name that satisfies its equality, list or pattern test."""
    for found in _EQUALS.finditer(template.source):
        left, right = found[1], found[2]
        if right[0].isalpha() or right[0] == "_":
            yield left, _Name(right)
            yield right, _Name(left)
        else:
            yield left, _constant(right)
    for found in _ONE_OF.finditer(template.source):
        yield found[1], _constant(found[2])
    for found in _MATCH.finditer(template.source):
        yield found[1], example(compile_pattern(found[2]), {})


def _constant(text: str) -> object:
    if text[0] in "'\"":
        return text[1:-1]
    return float(text) if "." in text else int(text, 16 if text.startswith("0x") else 10)


def correlated(match: Template, known: Mapping[str, object]) -> dict[str, object]:
    """Return the reply's fields that are constants or repeat a request field."""
    return {
        left: known[right] if isinstance(right, _Name) else right
        for left, right in _equalities(match)
        if not isinstance(right, _Name) or right in known
    }


def typed_arguments(
    found: Mapping[str, object], arguments: Mapping[str, Argument]
) -> dict[str, object] | None:
    """Return the typed arguments of a frame, or None if a value does not fit its type."""
    typed: dict[str, object] = {}
    for name, raw in found.items():
        argument = arguments.get(name)
        try:
            typed[name] = _as("", raw) if argument is None else _value(argument, raw)
        except ValueError:
            return None
    return typed


def guesses(
    arguments: Mapping[str, Argument], found: Mapping[str, object]
) -> Iterator[dict[str, object]]:
    """Yield the arguments with each possible value of a missing argument, such as true and false.

    An argument is guessed only if all other arguments are known and the argument has few possible
    values.
    """
    left = [one for name, one in arguments.items() if name not in found]
    if len(left) == 1:
        choices = (True, False) if left[0].type == "boolean" else left[0].choices
        for value in choices:
            yield {**found, left[0].name: value}


def is_alike(made: Payload, came: Payload) -> bool:
    """Return whether a frame equals the built frame, ignoring additional envelope attributes."""
    if not isinstance(made, Envelope) or not isinstance(came, Envelope):
        return made == came
    said = came.attributes
    return (
        made.verb == came.verb
        and all(said.get(name) == value for name, value in made.attributes.items())
        and (made.body or None) == (came.body or None)
    )


def _value(argument: Argument, raw: object) -> object:
    if argument.type != "array":
        return _as(argument.type, raw)
    items = elements_of(raw)
    if argument.size is not None and len(items) != argument.size:
        raise ValueError(raw)
    return tuple(_as(argument.items, item) for item in items)


def _as(kind: str, raw: object) -> object:
    if not isinstance(raw, str) or kind == "string":
        return raw
    if kind == "integer":
        return int(raw)
    if kind == "number":
        return int(raw) if _is_whole(raw) else float(raw)
    if kind == "boolean":
        if raw.lower() not in ("true", "false", "1", "0", "on", "off"):
            raise ValueError(raw)
        return raw.lower() in ("true", "1", "on")
    return int(raw) if _is_whole(raw) and raw[0] != "-" else raw


def _is_whole(raw: str) -> bool:
    """Return whether the text is an integer literal of an expression."""
    digits = raw.removeprefix("-")
    return digits.isdecimal() and digits.isascii() and str(int(raw)) == raw
