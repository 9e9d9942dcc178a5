"""The form ``regex``: a pattern whose named groups are the fields."""

from collections.abc import Mapping
from typing import cast

from urc.expressions import quoted
from urc.model.codec import Payload, ReadSpec
from urc.patterns import Pattern, example
from urc.protocol.codec import CodecContext, Frame, NotWritable
from urc.protocol.texts import encoded, field_text

__all__ = ["RegexReader"]


class RegexReader:
    """Reads text by a pattern; writes the shortest text that the pattern takes."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._pattern = cast("Pattern", spec.options["pattern"])
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the named groups; one that took no part is left out."""
        found = self._pattern.search(frame.text)
        if found is None:
            return None
        return {name: text for name, text in found.items() if text is not None}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return text with `fields` in the places of the groups."""
        texts = {name: field_text(value) for name, value in fields.items()}
        text = example(self._pattern, texts)
        found = self._pattern.search(text)
        if found is None or any(found[name] != texts[name] for name in texts if name in found):
            raise NotWritable(f"no text with {quoted(texts)} fits {self._pattern.source!r}")
        return encoded(text, self._encoding)
