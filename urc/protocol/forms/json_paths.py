"""The form ``json`` for reading: fields at paths in a document.

Theory of operation. Paths without expressions become `msgspec` types with one member for each path
step. The `msgspec` decoder skips all other data, and a generated function extracts the fields
(`urc.protocol.compile.source`). If a document has a different structure, the decoder raises an
error. The reader then decodes the whole document and follows the paths step by step. JMESPath
expressions always require decoding the whole document. Decoding with the types and decoding the
whole document return the same fields.
"""

import json
from collections.abc import Callable, Mapping
from typing import Any, Final, cast

import msgspec

from urc.images import media_type
from urc.model.payload import Envelope, Payload, ReadSpec
from urc.model.text import JsonPath
from urc.protocol.forms.json_types import build_pick, plan_of
from urc.protocol.values.payload import CodecContext, Frame, NotWritable

__all__ = ["JsonReader"]

_MISSING: Final = object()
_Find = Callable[[Any], object]


class JsonReader:
    """A reader for the values at given paths; it also writes documents with such values."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        paths = cast("Mapping[str, object]", spec.options["paths"])
        self._paths: dict[str, JsonPath] = {
            name: path for name, path in paths.items() if isinstance(path, tuple)
        }
        others = {name: path for name, path in paths.items() if not isinstance(path, tuple)}
        self._finders: dict[str, _Find] = {
            **{name: _walker(path) for name, path in self._paths.items()},
            **{name: _searcher(path) for name, path in others.items()},
        }
        self._is_utf8 = context.encoding in ("utf-8", "ascii")
        self.plan = plan_of(self._paths) if self._is_utf8 and not others else None
        self.pick = None if self.plan is None else build_pick(self.plan)
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields found; None if the document is invalid or has none of the fields."""
        if self.pick is not None and isinstance(frame.payload, bytes):
            try:
                return self.pick(frame.payload)
            except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
                pass  # another structure: decode the whole document
        return self.read_whole(frame)

    def read_whole(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the same fields as `read` without using the generated types."""
        document = self._document(frame)
        if document is _MISSING:
            return None
        found = {name: find(document) for name, find in self._finders.items()}
        return {name: value for name, value in found.items() if value is not _MISSING} or None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a JSON document with `fields` at their paths."""
        root: dict[str, Any] = {}
        for name in fields.keys() & self._finders.keys() - self._paths.keys():
            raise NotWritable(f"{name}: a JMESPath expression cannot be inverted")
        for name, path in self._paths.items():  # in order: some readers need the kind first
            if name in fields and not path:
                root = _whole(fields[name])
            elif name in fields:
                _put(root, path, fields[name])
        try:
            payload = json.dumps(root, separators=(",", ":"), default=_plain).encode("utf-8")
        except (TypeError, ValueError, RecursionError) as error:
            raise NotWritable(f"these values cannot be written as JSON: {error}") from None
        found = self.read(Frame(payload, self._encoding))
        if found is None or not fields.keys() <= found.keys():
            raise NotWritable("no values to write, or conflicting paths")
        return payload

    def _document(self, frame: Frame) -> object:
        payload = frame.payload
        if isinstance(payload, Envelope):
            if not isinstance(payload.body, (bytes, str)):
                return _MISSING if payload.body is None else payload.body
            payload = payload.body if isinstance(payload.body, bytes) else payload.body.encode()
        text = payload if self._is_utf8 else frame.text
        try:
            return msgspec.json.decode(text)
        except (msgspec.DecodeError, RecursionError, UnicodeError):
            pass
        try:
            return json.loads(text)  # accepts NaN, which some robots written in Python send
        except (ValueError, RecursionError):
            return _MISSING


def _walker(path: JsonPath) -> _Find:
    def find(document: Any) -> object:
        for step in path:
            if isinstance(step, str):
                if not isinstance(document, Mapping) or step not in document:
                    return _MISSING
            elif not isinstance(document, (list, tuple)) or step >= len(document):
                return _MISSING
            document = document[step]
        return document

    return find


def _searcher(expression: Any) -> _Find:
    from jmespath.exceptions import JMESPathError

    def find(document: Any) -> object:
        try:
            value: object = expression.search(document)
        except (JMESPathError, ArithmeticError, RecursionError, TypeError, ValueError):
            return _MISSING
        return _MISSING if value is None else value

    return find


def _put(root: dict[str, Any], path: JsonPath, value: object) -> None:
    """Set the value at `path`, creating missing parents."""
    holder: Any = root
    for step, after in zip(path, (*path[1:], None), strict=True):
        if isinstance(step, int):
            if not isinstance(holder, list):
                return  # another path needs another type here; `write` detects the missing value
            holder += [None] * (step + 1 - len(holder))
        elif not isinstance(holder, dict):
            return
        if after is None:
            holder[step] = value
            return
        inner = holder[step] if isinstance(step, int) else holder.get(step)
        if inner is None:
            inner = holder[step] = [] if isinstance(after, int) else {}
        holder = inner


def _whole(value: object) -> dict[str, Any]:
    """Return a document that consists of one field; an image is a sensor_msgs/CompressedImage."""
    if isinstance(value, bytes):
        return {"format": media_type(value).partition("/")[2], "data": _plain(value)}
    return cast("dict[str, Any]", value)


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        from urc.protocol.values.vectors import bytes_text

        return bytes_text(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
