"""Markdown of a document's author → HTML, for the templates of widgets.

Floor 5. Rendered here and not in the page: it is read before any module has loaded, and the page's
policy refuses markup that is made of text. HTML in it stays text, pictures stay words, and links
lead out of the page or nowhere. What a robot says is never given to it.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from markupsafe import Markup

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

__all__ = ["markdown"]

FIRST_HEADING = 4
"""Level of ``#``: the page and the cells have the levels above it."""


def markdown(text: str) -> Markup:
    """Return the HTML of a text in CommonMark, with tables and strikethrough."""
    parser = _parser()
    tokens = parser.parse(text)
    _lower_headings(tokens)
    _open_links_elsewhere(tokens)
    return Markup(parser.renderer.render(tokens, parser.options, {}))  # noqa: S704  # no HTML in it


def _lower_headings(tokens: Sequence["Token"]) -> None:
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(6, int(token.tag[1:]) + FIRST_HEADING - 1)}"


def _open_links_elsewhere(tokens: Sequence["Token"]) -> None:
    """A link that takes the page away would take the controls away."""
    for token in tokens:
        for child in token.children or ():
            if child.type == "link_open":
                child.attrSet("target", "_blank")
                child.attrSet("rel", "noopener noreferrer")


@lru_cache(maxsize=1)
def _parser() -> "MarkdownIt":
    from markdown_it import MarkdownIt  # only pages with such a widget need it

    parser = MarkdownIt("commonmark", {"html": False, "linkify": False})
    return parser.enable(["table", "strikethrough"]).disable("image")
