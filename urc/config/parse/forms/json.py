"""The ``json`` form: fields of a JSON document, addressed by JMESPath expressions.

The parser converts plain paths such as ``a.b[0].c`` to tuples, which the engine evaluates itself.
The path ``@``, the whole document, becomes the empty tuple.
All other paths need the JMESPath library.
"""

import re
from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec
from urc.model.text import JsonPath

__all__ = ["parse_read", "place_of"]

_NAME = r'(?:[A-Za-z_][A-Za-z0-9_]*|"[^"\\]+")'
_PLAIN = re.compile(rf"{_NAME}(?:\.{_NAME}|\[[0-9]{{1,5}}\])*")
_WHOLE = "@"
"""JMESPath's expression for the whole document."""
_DOTTED_INDEX = re.compile(r"(?<=[\w\]])\.([0-9]{1,5})(?![\w])")
"""An index as other programs write it, such as ``.0`` in ``cells.0``."""
_STEP = re.compile(r'([A-Za-z_][A-Za-z0-9_]*)|"([^"\\]+)"|\[([0-9]+)\]')


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the path of each field, as a tuple or as a compiled expression."""
    paths: dict[str, object] = {}
    is_good = True
    for name, inner in part.entries().items():
        path = _path(inner, problems)
        is_good = is_good and path is not None
        paths[name] = path
    return ReadSpec("json", {"paths": paths}, tuple(paths)) if is_good else None


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the field's name."""
    return part.must(field), {"key": True}


def _path(part: Node, problems: Problems) -> object:
    text = part.data.strip()
    if text == _WHOLE:
        return ()
    if _PLAIN.fullmatch(text):
        return _plain(text)
    import jmespath  # takes 20 ms, and most drivers do not need it
    from jmespath.exceptions import JMESPathError

    try:
        return jmespath.compile(text)
    except JMESPathError as error:
        offset, length = getattr(error, "lex_position", None) or 0, 1
        hint = "paths start without '$', such as battery.level" if text.startswith("$") else ""
        if _DOTTED_INDEX.search(text):
            written = _DOTTED_INDEX.sub(r"[\1]", text)
            offset, length, hint = 0, len(text), f'an index is in brackets: "{written}"'
        message = f"{text!r} is not a JMESPath expression"
        problems.error(part, "bad-path", message, offset=offset, length=length, hint=hint)
    except RecursionError:
        problems.error(part, "bad-path", "the expression is nested too deeply")
    return None


def _plain(text: str) -> JsonPath:
    return tuple(
        int(found[3]) if found[3] else found[1] or found[2] for found in _STEP.finditer(text)
    )
