"""The ``text`` form: a template with text and expressions."""

from collections.abc import Iterable
from typing import cast

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.expressions import Template
from urc.model.payload import WriteSpec

__all__ = ["parse_write", "templates"]


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the declaration of the frame with the compiled template at `part`."""
    template = problems.template(part)
    if template is None:
        return None
    return WriteSpec("text", {"template": template}, template.names, template.settings)


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return the template of the frame."""
    yield part, cast("Template", spec.options["template"])
