"""The form ``text``: a template, as written under ``send:``."""

import re
from collections.abc import Mapping
from functools import cached_property
from typing import cast

from urc.expressions import Template, split_template, text_of
from urc.model.codec import Payload, WriteSpec
from urc.patterns import Pattern, compile_pattern
from urc.protocol.forms import BadText, CodecContext, Frame, NotWritable

__all__ = ["TextWriter"]

_NAME = re.compile(r"\s*([A-Za-z_][A-Za-z0-9_]*)\s*")


class TextWriter:
    """Writes a rendered template; reads one back where its expressions are plain names."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        self._template = cast("Template", spec.options["template"])
        self._encoding = context.encoding

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the rendered text in the line's encoding."""
        text = text_of(self._template.evaluate(namespace))
        try:
            return text.encode(self._encoding)
        except UnicodeEncodeError as error:
            wrong = error.object[error.start]
            raise NotWritable(f"{wrong!r} cannot be written in {self._encoding}") from None

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return what stands in the places of the plain names, as text."""
        try:
            return self._reverse.search(frame.text)
        except BadText:
            return None

    @cached_property
    def _reverse(self) -> Pattern:
        pieces = ["(?s)^"]
        seen: set[str] = set()
        for _, literal, expression in split_template(self._template.source):
            if expression is None:
                pieces.append(re.escape(literal))
                continue
            name = _NAME.fullmatch(expression)
            if name is not None and name[1] not in seen:
                seen.add(name[1])
                pieces.append(f"(?P<{name[1]}>.*?)")
            else:
                pieces.append(".*?")
        return compile_pattern("".join(pieces) + "$")
