"""Constant bytes and expressions in one frame, for the forms ``hex`` and ``bytes``."""

from collections.abc import Sequence
from typing import NamedTuple, cast

from urc.config.node import Node
from urc.expressions import Template
from urc.model.payload import WriteSpec

__all__ = ["Piece", "Placed", "spec_of", "templates_at"]

Piece = bytes | Template


class Placed(NamedTuple):
    """Constant bytes or an expression, with the path of its text under the form's key."""

    piece: Piece
    path: tuple[int, ...] = ()
    offset: int = 0
    """Offset of the expression in the text at `path`, in characters."""


def spec_of(form: str, pieces: Sequence[Placed]) -> WriteSpec:
    """Return the declaration of a frame in the form `form`, built from its pieces."""
    templates = [
        (path, _moved(one, offset)) for one, path, offset in pieces if isinstance(one, Template)
    ]
    names = frozenset[str]().union(*(one.names for _, one in templates))
    settings = frozenset[str]().union(*(one.settings for _, one in templates))
    options = {"pieces": tuple(one for one, _, _ in pieces), "uses": tuple(templates)}
    return WriteSpec(form, options, names, settings)


def _moved(template: Template, offset: int) -> Template:
    """Return the expression with leading spaces to keep error positions correct."""
    source = " " * offset + template.source
    return Template(source, template.python, template.names, template.settings)


def templates_at(part: Node, spec: WriteSpec) -> list[tuple[Node, Template]]:
    """Return every expression with its position."""
    uses = cast("tuple[tuple[tuple[int, ...], Template], ...]", spec.options.get("uses", ()))
    return [(part.items()[path[0]] if path else part, template) for path, template in uses]
