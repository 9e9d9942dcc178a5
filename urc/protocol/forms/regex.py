"""The form ``regex``: a pattern with fields as named groups."""

from collections.abc import Iterator, Mapping
from typing import Final, cast

from urc.expressions import quoted
from urc.model.payload import Payload, ReadSpec
from urc.patterns import Pattern, example
from urc.protocol.values.payload import CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import encoded, field_text

__all__ = ["RegexReader"]

_WIDEST: Final = 16
"""Maximum length, in characters, of the spellings of a number that are tried."""
_PLACES: Final = 6


class RegexReader:
    """A reader for text that matches a pattern; it also writes the shortest matching text."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._pattern = cast("Pattern", spec.options["pattern"])
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the named groups that participated in the match, keyed by name."""
        found = self._pattern.search(frame.text)
        if found is None:
            return None
        return {name: text for name, text in found.items() if text is not None}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return text that matches the pattern, with `fields` as the named groups."""
        texts = {name: self._text(name, value) for name, value in fields.items()}
        text = example(self._pattern, texts)
        found = self._pattern.search(text)
        if found is None or any(found[name] != texts[name] for name in texts if name in found):
            raise NotWritable(f"no text with {quoted(texts)} matches {self._pattern.source!r}")
        return encoded(text, self._encoding)

    def _text(self, name: str, value: object) -> str:
        """Return a field's text as its named group requires it, for example with leading zeros."""
        text = field_text(value)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or len(text) > _WIDEST or name not in self._pattern.groups:
            return text
        if self._takes(name, text):
            return text
        return next((one for one in _padded(text) if self._takes(name, one)), text)

    def _takes(self, name: str, text: str) -> bool:
        found = self._pattern.search(example(self._pattern, {name: text}))
        return found is not None and found[name] == text


def _padded(text: str) -> Iterator[str]:
    """Yield alternative spellings of a number: leading zeros, a sign, more or fewer decimals."""
    own = len(text.partition(".")[2])
    number = float(text)
    for places in (*range(own, -1, -1), *range(own + 1, _PLACES + 1)):
        plain = f"{number:.{places}f}"
        for sign in ("", "+") if number >= 0 else ("",):
            for width in range(1, _WIDEST + 1):
                yield f"{sign}{plain}".zfill(width)
