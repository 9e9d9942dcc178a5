"""Places that a message goes to, with values in them: paths of requests, and topics.

Floor 3, pure. A value is a word of its place: it may not lead elsewhere. A value that is the whole
place may have several words; what the operator has set is as good as written in the document.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, NamedTuple
from urllib.parse import quote

from urc.expressions import Template, compile_template, quoted, split_template, text_of
from urc.protocol.codec import NotWritable

__all__ = ["Place", "place_writer"]

_SETTINGS: Final = frozenset(("settings",))
_WILD: Final = ("+", "#", "\0")
_UP: Final = (".", "..")


class _Piece(NamedTuple):
    template: Template
    is_value: bool
    """Whether it is what somebody has given, and not part of the document or its settings."""


class Place:
    """Writes one place."""

    def __init__(self, pieces: tuple[_Piece, ...], written: Callable[[str, bool], str]) -> None:
        """Join `pieces`; `written` makes a word of a value, which may be the whole place."""
        self._pieces = pieces
        self._written = written

    def write(self, namespace: Mapping[str, object]) -> str:
        """Return the place; raise `NotWritable` or `ExpressionError`."""
        is_whole = len(self._pieces) == 1
        words = [
            self._written(text, is_whole) if is_value else text
            for text, is_value in (
                (text_of(one.template.evaluate(namespace)), one.is_value) for one in self._pieces
            )
        ]
        return "".join(words)


def place_writer(name: str, tree: object) -> Place | None:
    """Return what writes the attribute `name`; None where it is as good as plain text.

    Args:
        name: ``path``, ``topic`` …
        tree: the attribute as it was compiled.
    """
    written = _WRITTEN.get(name)
    if written is None or not isinstance(tree, Template) or tree.names <= _SETTINGS:
        return None
    pieces = []
    for _, literal, expression in split_template(tree.source):
        one = compile_template(literal if expression is None else f"{{{{{expression}}}}}")
        pieces.append(_Piece(one, not one.names <= _SETTINGS))
    return Place(tuple(pieces), written)


def _path(text: str, is_whole: bool) -> str:
    """Return a value as a part of a path."""
    parts = text.split("/") if is_whole else [text]
    if any(part in _UP for part in parts):
        raise NotWritable(f"{quoted(text)} would lead to another path")
    return quote(text, safe="/" if is_whole else "")


def _name(text: str, is_whole: bool, *, what: str) -> str:
    """Return a value as a part of the name of a topic, a service or an action."""
    for sign in (*_WILD, *(() if is_whole else ("/",))):
        if sign in text:
            raise NotWritable(
                f"{quoted(text)} would lead to another {what}: {sign!r} may not be in it"
            )
    return text


_WRITTEN: Final[Mapping[str, Callable[[str, bool], str]]] = {
    "path": _path,
    **{what: partial(_name, what=what) for what in ("topic", "service", "action")},
}
