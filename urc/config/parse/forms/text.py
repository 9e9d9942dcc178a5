"""The form ``text``: a template, as written under ``send:``."""

from collections.abc import Iterable
from typing import cast

from urc.config.parse.form import FormContext
from urc.config.part import Findings, Part
from urc.expressions import Template
from urc.model.codec import WriteSpec

__all__ = ["parse_write", "templates"]


def parse_write(part: Part, findings: Findings, context: FormContext) -> WriteSpec | None:
    """Return the template at `part`."""
    template = findings.template(part)
    if template is None:
        return None
    return WriteSpec("text", {"template": template}, template.names, template.settings)


def templates(part: Part, spec: WriteSpec) -> Iterable[tuple[Part, Template]]:
    """Return the one template."""
    yield part, cast("Template", spec.options["template"])
