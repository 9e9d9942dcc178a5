"""Frames' forms, made without a document."""

from urc.expressions import compile_template
from urc.model.codec import ReadSpec, WriteSpec
from urc.patterns import compile_pattern

__all__ = ["regex", "text"]


def regex(source: str) -> ReadSpec:
    """Return the form ``regex`` of a reply or message."""
    pattern = compile_pattern(source)
    return ReadSpec("regex", {"pattern": pattern}, pattern.groups)


def text(source: str) -> WriteSpec:
    """Return the form ``text`` of what is sent."""
    template = compile_template(source)
    return WriteSpec("text", {"template": template}, template.names, template.settings)
