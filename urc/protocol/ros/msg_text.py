"""Definitions in ``.msg`` text, as sent by robots (``ros2msg``, ``ros1msg``).

Pure. The text contains one definition per type. The first definition has no name. Each later
definition follows a line of ``=`` and a line ``MSG: pkg/Type``. The grammar follows the ROS 2 page
“Interfaces” and the ROS 1 page “msg”.
"""

import re
from typing import Final

from urc.problems import printable
from urc.protocol.ros.definition import (
    MAX_FIXED,
    MAX_TEXT,
    MAX_TYPES,
    BadDefinition,
    Definition,
    Definitions,
    MessageField,
    plain_name,
)

__all__ = ["parse_lines", "parse_msg", "split_types"]

_TYPE: Final = re.compile(r"([A-Za-z][A-Za-z0-9_/]*)(?:<=([0-9]{1,9}))?(?:\[(<=)?([0-9]{0,9})\])?")
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SHOWN: Final = 60
_INTEGERS: Final = re.compile(r"u?int(8|16|32|64)|byte|char|octet")


def split_types(name: str, text: str, mark: str) -> list[tuple[str, str]]:
    """Split `text` into types; return the name and the definition text of each type.

    Args:
        name: name of the first type.
        text: text of all types.
        mark: word that precedes the name of every type after the first, such as ``MSG:``.

    Raises:
        BadDefinition: the text is too long or contains too many types.
    """
    if len(text) > MAX_TEXT:
        raise BadDefinition(f"the definition of {name} has more than {MAX_TEXT} characters")
    found: list[tuple[str, list[str]]] = [(plain_name(name), [])]
    is_new = False
    for line in text.splitlines():
        if line.startswith("====") and not line.strip("= "):
            is_new = True
        elif is_new and line.startswith(mark):
            is_new = False
            inner = plain_name(line[len(mark) :].strip())
            # In IDL, the text of the first type has a name, too.
            if len(found) == 1 and not any(one.strip() for one in found[0][1]):
                found[0] = (found[0][0] if inner == found[0][0] else inner, [])
            else:
                found.append((inner, []))
            if len(found) > MAX_TYPES:
                raise BadDefinition(f"the definition of {name} has more than {MAX_TYPES} types")
        else:
            found[-1][1].append(line)
    return [(inner, "\n".join(lines)) for inner, lines in found]


def parse_msg(name: str, text: str) -> Definitions:
    """Return the definitions in ``.msg`` text.

    Args:
        name: name of the first type, in any form.
        text: text of all types.

    Raises:
        BadDefinition: the text is invalid; the message contains the invalid line.
    """
    found: dict[str, Definition] = {}
    for inner, part in split_types(name, text, "MSG:"):
        fields: dict[str, MessageField] = {}
        constants: dict[str, object] = {}
        for line in part.splitlines():
            bare = line.strip()
            if bare and not bare.startswith("#"):
                _read_line(bare, fields, constants, inner)
        found.setdefault(inner, Definition(inner, tuple(fields.values()), constants))
    return found


def parse_lines(text: str) -> dict[str, Definition]:
    """Return the definitions in a list of types, each ``pkg/Type: TYPE NAME, TYPE NAME, …``.

    A line that begins with two spaces continues the previous line.
    """
    found: dict[str, Definition] = {}
    for line in text.replace("\n  ", " ").splitlines():
        name, _, fields = line.partition(":")
        found |= parse_msg(name, fields.replace(", ", "\n"))
    return found


def _read_line(
    line: str, fields: dict[str, MessageField], constants: dict[str, object], owner: str
) -> None:
    kind = _TYPE.match(line)
    rest = line[kind.end() :].lstrip() if kind else ""
    name = _NAME.match(rest)
    if kind is None or name is None or not line[kind.end()].isspace():
        raise BadDefinition(f"{owner}: {printable(line[:_SHOWN])!r} is not a field")
    word, _, at_most, size = kind.groups()
    after = rest[name.end() :].lstrip()
    if after.startswith("="):
        value = after[1:].strip()
        constants[name[0]] = value if word in ("string", "wstring") else _value(word, value, owner)
        return
    length = None if size is None else int(size or 0)
    bound = int(size) if at_most and size else None
    length = 0 if at_most else length
    if length is not None and length > MAX_FIXED:
        raise BadDefinition(f"{owner}: the array {name[0]} has {length} elements")
    if name[0] in fields:
        raise BadDefinition(f"{owner} has two fields named {name[0]}")
    fields[name[0]] = MessageField(
        name[0], word, length, _default(word, after, length, owner), bound
    )


def _default(word: str, text: str, length: int | None, owner: str) -> object:
    """Return the default value after a field name, or None; any comment is ignored."""
    if not text or text.startswith("#"):
        return None
    if length is None:
        return _value(word, text, owner)
    inner = text.partition("#")[0].strip()
    if not (inner.startswith("[") and inner.endswith("]")):
        raise BadDefinition(f"{owner}: {printable(text[:_SHOWN])!r} is not a list")
    parts = [part.strip() for part in inner[1:-1].split(",")]
    return [_value(word, part, owner) for part in parts if part]


def _value(word: str, text: str, owner: str) -> object:
    """Convert a literal to the primitive type `word`, and return the value."""
    if word in ("string", "wstring"):
        quote = text[:1]
        end = text.find(quote, 1) if quote in ("'", '"') else -1
        return text[1:end] if end > 0 else text.partition("#")[0].strip()
    bare = text.partition("#")[0].strip()
    try:
        if word == "bool":
            return {"true": True, "1": True, "false": False, "0": False}[bare.lower()]
        return int(bare, 0) if _INTEGERS.fullmatch(word) else float(bare)
    except (KeyError, ValueError):
        pass
    raise BadDefinition(f"{owner}: {printable(text[:_SHOWN])!r} is not a valid {word}") from None
