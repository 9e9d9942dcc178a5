"""The forms ``split`` and ``keyvalue``: values between separators, by place or by key."""

from collections.abc import Mapping
from typing import cast

from urc.model.codec import Payload, ReadSpec
from urc.protocol.forms import CodecContext, Frame, NotWritable
from urc.protocol.texts import encoded, field_text, written_differently

__all__ = ["KeyvalueReader", "SplitReader"]


class SplitReader:
    """Reads values by their place. An empty part is a value that is not available."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        options = spec.options
        self._by = cast("str", options["by"]) or None
        self._names = cast("tuple[str, ...]", options["names"])
        self._has_more = bool(options["has_more"])
        self._strip = cast("str | None", options["strip"])
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the parts by name, or None when there are too few or too many."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        parts, names, strip = text.split(self._by), self._names, self._strip
        if len(parts) < len(names) or (len(parts) > len(names) and not self._has_more):
            return None
        return {
            name: part.strip(strip) or None
            for name, part in zip(names, parts, strict=False)
            if name
        }

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the parts in their places; one that is not given is empty, or a dash."""
        filler = "" if self._by else "-"
        parts = [field_text(fields.get(name)) or filler for name in self._names]
        text = (self._by or " ").join(parts)
        wrong = written_differently(fields, self._read(text))
        if wrong:
            raise NotWritable(f"{wrong}: {fields[wrong]!r} cannot be a part of {text!r}")
        return encoded(text, self._encoding)


class KeyvalueReader:
    """Reads values by their key. An empty value is one that is not available."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        options = spec.options
        self._pairs = cast("str", options["pairs"])
        self._separator = cast("str", options["separator"])
        self._names = dict(cast("Mapping[str, str]", options["keys"]))
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values of the keys that are known, or None when none is there."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        names, separator = self._names, self._separator
        found: dict[str, object] = {}
        for pair in text.split(self._pairs):
            key, between, value = pair.partition(separator)
            if between:
                name = names.get(key.strip())
                if name is not None:
                    found[name] = value.strip() or None
        return found or None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the pairs of the fields given."""
        keys = {name: key for key, name in self._names.items()}
        texts = {keys[name]: field_text(value) for name, value in fields.items() if name in keys}
        text = self._pairs.join(key + self._separator + value for key, value in texts.items())
        wrong = written_differently(fields, self._read(text))
        if wrong or not texts:
            raise NotWritable(f"{wrong or 'nothing'} cannot be a pair of {text!r}")
        return encoded(text, self._encoding)
