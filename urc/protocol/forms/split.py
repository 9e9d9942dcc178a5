"""The forms ``split`` and ``keyvalue``: values between separators, by position or by key."""

from collections.abc import Mapping
from typing import cast

from urc.expressions import quoted
from urc.model.payload import Payload, ReadSpec
from urc.protocol.values.payload import CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import encoded, field_text, written_differently

__all__ = ["KeyvalueReader", "SplitReader"]


class SplitReader:
    """A reader for values identified by position; an empty part means an unavailable value."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        options = spec.options
        self._by = cast("str", options["by"]) or None
        self._names = cast("tuple[str, ...]", options["names"])
        self._has_more = bool(options["has_more"])
        self._strip = cast("str | None", options["strip"])
        self._tail = cast("str", options.get("tail", ""))
        """Name of the field that contains all remaining parts as a list; "" if there is no such
        field."""
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the parts, keyed by name; return None if the number of parts is wrong."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        parts, names, strip = text.split(self._by), self._names, self._strip
        if self._tail:
            return self._with_tail(parts)
        if len(parts) < len(names) or (len(parts) > len(names) and not self._has_more):
            return None
        return {
            name: part.strip(strip) or None
            for name, part in zip(names, parts, strict=False)
            if name
        }

    def _with_tail(self, parts: list[str]) -> dict[str, object] | None:
        """Return the parts, keyed by name; the last name has a list of all remaining parts."""
        first, strip = len(self._names) - 1, self._strip
        if len(parts) < first:
            return None
        values = [part.strip(strip) or None for part in parts]
        found: dict[str, object] = {
            name: value for name, value in zip(self._names[:-1], values, strict=False) if name
        }
        found[self._tail] = values[first:]
        return found

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the joined parts, with empty text or a dash for each missing part."""
        filler = "" if self._by else "-"
        names = self._names[:-1] if self._tail else self._names
        parts = [field_text(fields.get(name)) or filler for name in names]
        more = fields.get(self._tail) if self._tail else None
        if more is not None:
            listed = more if isinstance(more, (list, tuple)) else [more]
            parts += [field_text(one) or filler for one in listed]
        text = (self._by or " ").join(parts)
        wrong = written_differently(fields, self._read(text))
        if wrong:
            raise NotWritable(
                f"{wrong}: {quoted(fields[wrong])} differs when read back from {quoted(text)}"
            )
        return encoded(text, self._encoding)


class KeyvalueReader:
    """A reader for values identified by key; a key without text means an unavailable value."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        options = spec.options
        self._pairs = cast("str", options["pairs"])
        self._separator = cast("str", options["separator"])
        self._names = dict(cast("Mapping[str, str]", options["keys"]))
        self._first = cast("tuple[str, ...]", options.get("first", ()))
        """Names of the leading parts, which are not key-value pairs."""
        self._strip = cast("str | None", options.get("strip"))
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values of the known keys; None if no key is known."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        names, separator, strip = self._names, self._separator, self._strip
        found: dict[str, object] = {}
        pairs = text.split(self._pairs)
        if self._first:
            bare = self._bare(pairs)
            if bare is None:
                return None
            found |= bare
        for pair in pairs:
            key, between, value = pair.partition(separator)
            if between:
                name = names.get(key.strip(strip))
                if name is not None:
                    found[name] = value.strip(strip) or None
        return found or None

    def _bare(self, pairs: list[str]) -> dict[str, object] | None:
        """Remove and return the leading parts; None if one is missing or has a separator."""
        parts = [part for part in pairs if part.strip(self._strip)]
        front = parts[: len(self._first)]
        if len(front) < len(self._first) or any(self._separator in part for part in front):
            return None
        pairs[:] = parts[len(front) :]
        named = zip(self._first, front, strict=True)
        return {name: part.strip(self._strip) for name, part in named if name}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return `fields` as key-value pairs in one string."""
        keys = {name: key for key, name in self._names.items()}
        texts = {keys[name]: field_text(value) for name, value in fields.items() if name in keys}
        pairs = [field_text(fields.get(name)) or "-" for name in self._first]
        pairs += [key + self._separator + value for key, value in texts.items()]
        text = self._pairs.join(pairs)
        wrong = written_differently(fields, self._read(text))
        if wrong or not pairs:
            raise NotWritable(f"{wrong or 'nothing'} cannot be written as a pair in {quoted(text)}")
        return encoded(text, self._encoding)
