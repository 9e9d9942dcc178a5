"""What the templates of widgets are compiled in: Jinja without a way out, and few words.

Floor 5. It bounds neither time nor memory: `urc.web.show.markup_apart` does, for foreign widgets.
"""

import traceback
from functools import lru_cache
from typing import Final

from jinja2 import Environment, StrictUndefined, Template, TemplateSyntaxError
from jinja2.sandbox import ImmutableSandboxedEnvironment

from urc.web import words
from urc.web.show.markdown import markdown

__all__ = ["TEMPLATE", "fault_line", "widget_environment", "widget_template"]

TEMPLATE: Final = "template.html.j2"
_CODE: Final = "<template>"
"""What Jinja calls the file of a template that it was given as text."""


@lru_cache(maxsize=1)
def widget_environment() -> Environment:
    """Return what the templates of widgets are compiled in."""
    widgets = ImmutableSandboxedEnvironment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    widgets.globals["t"] = words.t
    widgets.filters["markdown"] = markdown
    return widgets


@lru_cache(maxsize=256)
def widget_template(source: str) -> Template:
    """Return a compiled template; raise what Jinja raises."""
    return widget_environment().from_string(source)


def fault_line(fault: Exception) -> int:
    """Return the line of a widget's template in which it failed, from 1."""
    if isinstance(fault, TemplateSyntaxError):
        return fault.lineno
    frames = traceback.extract_tb(fault.__traceback__)
    lines = [frame.lineno or 1 for frame in frames if frame.filename == _CODE]
    return lines[-1] if lines else 1
