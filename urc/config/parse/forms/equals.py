"""The ``equals`` form: the frame is constant text."""

from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec

__all__ = ["parse_read", "place_of"]


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the text."""
    try:
        part.data.encode(context.encoding)
    except UnicodeEncodeError as error:
        wrong = error.object[error.start]
        text = f"{wrong!r} cannot be encoded as {context.encoding}"
        problems.error(part, "not-in-encoding", text, offset=error.start)
        return None
    return ReadSpec("equals", {"text": part.data})


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the constant text: the form has no fields."""
    return part, {}
