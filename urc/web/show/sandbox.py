"""The sandboxed Jinja environment for widget templates, with few global names.

Layer 5. The sandbox limits neither time nor memory; `urc.web.show.isolated_markup` sets these
limits for third-party widgets.
"""

import traceback
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from jinja2 import Environment, StrictUndefined, Template, TemplateSyntaxError
from jinja2.sandbox import ImmutableSandboxedEnvironment
from markupsafe import Markup

from urc.web import words

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

__all__ = ["TEMPLATE", "fault_line", "markdown", "widget_environment", "widget_template"]


FIRST_HEADING = 4
"""HTML heading level for ``#`` in Markdown; the page and its cells use the higher levels."""


def markdown(text: str) -> Markup:
    """Return CommonMark text as HTML, with support for tables and strikethrough."""
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
    """Open links in a new tab, because leaving the page would end control of the robot."""
    for token in tokens:
        for child in token.children or ():
            if child.type == "link_open":
                child.attrSet("target", "_blank")
                child.attrSet("rel", "noopener noreferrer")


@lru_cache(maxsize=1)
def _parser() -> "MarkdownIt":
    from markdown_it import MarkdownIt  # few pages need it

    parser = MarkdownIt("commonmark", {"html": False, "linkify": False})
    return parser.enable(["table", "strikethrough"]).disable("image")


TEMPLATE: Final = "template.html.j2"
_CODE: Final = "<template>"
"""Jinja's file name for a template given as text."""


@lru_cache(maxsize=1)
def widget_environment() -> Environment:
    """Return the Jinja environment for widget templates."""
    widgets = ImmutableSandboxedEnvironment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    widgets.globals["t"] = words.t
    widgets.filters["markdown"] = markdown
    return widgets


@lru_cache(maxsize=256)
def widget_template(source: str) -> Template:
    """Return a compiled template; propagate Jinja's exceptions."""
    return widget_environment().from_string(source)


def fault_line(fault: Exception) -> int:
    """Return the template line of a rendering failure, counted from 1."""
    if isinstance(fault, TemplateSyntaxError):
        return fault.lineno
    frames = traceback.extract_tb(fault.__traceback__)
    lines = [frame.lineno or 1 for frame in frames if frame.filename == _CODE]
    return lines[-1] if lines else 1
