"""Where the keys and values of a document stand.

Floor 0, private to `urc.source`.
"""

from typing import Any, NamedTuple

__all__ = ["Mark", "Span", "Written"]


class Span(NamedTuple):
    """A place in the text: lines and columns are 1-based, the end is exclusive."""

    line: int
    column: int
    end_line: int
    end_column: int


class Mark:
    """Where one value stands, where its key stands, and the marks of what is inside it."""

    __slots__ = ("children", "key", "origin", "span", "style", "written")

    def __init__(
        self, span: Span, style: str, children: "dict[str | int, Mark] | None" = None
    ) -> None:
        self.span = span
        self.style = style
        """"" plain, "'", '"', "|", ">", "{" a mapping or list, "*" an alias."""
        self.key: Span | None = None
        self.children = {} if children is None else children
        self.origin: Any = None
        """The document in which this and all inside it stand; None: the one around it."""
        self.written: Written | None = None
        """The text as it stands there, when the value was made from it."""

    def copy(self, children: "dict[str | int, Mark] | None" = None) -> "Mark":
        """Return a mark of the same place, with other children when some are given."""
        mark = Mark(self.span, self.style, self.children if children is None else children)
        mark.key, mark.origin, mark.written = self.key, self.origin, self.written
        return mark


class Written(NamedTuple):
    """A text before names in it were filled in."""

    text: str
    edits: tuple[tuple[int, int, int], ...]
    """Where each name stood, how long it was, and the length of what came in its place."""

    def offset(self, offset: int) -> int:
        """Return the character of the written text that led to character `offset` of the value."""
        shift = 0
        for start, before, after in self.edits:
            begin = start + shift
            if offset < begin:
                break
            if offset < begin + after:
                return start
            shift += after - before
        return offset - shift
