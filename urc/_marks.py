"""Positions of the keys and values of a document.

Private to `urc.source`.
"""

from typing import Any, NamedTuple

__all__ = ["Mark", "Span", "UnfilledText"]


class Span(NamedTuple):
    """A range of the text: lines and columns are 1-based, the end is exclusive."""

    line: int
    column: int
    end_line: int
    end_column: int


class Mark:
    """The position of one value and of its key, and the marks of its children."""

    __slots__ = ("children", "key", "origin", "span", "style", "written")

    def __init__(
        self, span: Span, style: str, children: "dict[str | int, Mark] | None" = None
    ) -> None:
        self.span = span
        self.style = style
        """Style of the value: "" plain, "'", '"', "|", ">", "{" a mapping or list, "*" an alias."""
        self.key: Span | None = None
        self.children = {} if children is None else children
        self.origin: Any = None
        """Document that contains this value and its children; None for the parent's document."""
        self.written: UnfilledText | None = None
        """Original text of a computed value."""

    def copy(self, children: "dict[str | int, Mark] | None" = None) -> "Mark":
        """Return a mark of the same place, with `children` if given."""
        mark = Mark(self.span, self.style, self.children if children is None else children)
        mark.key, mark.origin, mark.written = self.key, self.origin, self.written
        return mark


class UnfilledText(NamedTuple):
    """A text before the substitution of its names."""

    text: str
    edits: tuple[tuple[int, int, int], ...]
    """Start of each name, its length, and the length of its replacement."""

    def offset(self, offset: int) -> int:
        """Return the offset in the original text for character `offset` of the value."""
        shift = 0
        for start, before, after in self.edits:
            begin = start + shift
            if offset < begin:
                break
            if offset < begin + after:
                return start
            shift += after - before
        return offset - shift
