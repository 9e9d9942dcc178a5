"""Positions of the keys and values in a document.

Private to `urc.source`.
"""

from typing import Any, NamedTuple

__all__ = ["Mark", "Span", "UnfilledText"]


class Span(NamedTuple):
    """A range of text, with 1-based lines and columns and an exclusive end."""

    line: int
    column: int
    end_line: int
    end_column: int


class Mark:
    """The positions of a value and its key, and the marks of the value's children."""

    __slots__ = ("children", "key", "origin", "span", "style", "written")

    def __init__(
        self, span: Span, style: str, children: "dict[str | int, Mark] | None" = None
    ) -> None:
        self.span = span
        self.style = style
        """YAML style of the value: "" (plain), "'", '"', "|", ">", "{" (mapping or list) or "*"
        (alias)."""
        self.key: Span | None = None
        self.children = {} if children is None else children
        self.origin: Any = None
        """Document of the value and its children; None means the parent value's document."""
        self.written: UnfilledText | None = None
        """Original text of a value with substituted names; None for other values."""

    def copy(self, children: "dict[str | int, Mark] | None" = None) -> "Mark":
        """Return a copy of the mark, with new `children` if given."""
        mark = Mark(self.span, self.style, self.children if children is None else children)
        mark.key, mark.origin, mark.written = self.key, self.origin, self.written
        return mark


class UnfilledText(NamedTuple):
    """The original text of a value, before names were substituted."""

    text: str
    edits: tuple[tuple[int, int, int], ...]
    """For each substituted name: its offset and length in `text`, and its replacement's length."""

    def offset(self, offset: int) -> int:
        """Return the offset in the original text that corresponds to `offset` in the final text."""
        shift = 0
        for start, before, after in self.edits:
            begin = start + shift
            if offset < begin:
                break
            if offset < begin + after:
                return start
            shift += after - before
        return offset - shift
