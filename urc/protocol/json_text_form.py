"""The form ``json`` of what is sent: JSON text, with typed values in the places of templates."""

import json
from collections.abc import Mapping
from typing import Any

from urc.expressions import Template
from urc.model.codec import Payload, WriteSpec
from urc.protocol.forms import BadText, CodecContext, Frame, NotWritable

__all__ = ["JsonWriter"]


class JsonWriter:
    """Writes a value as compact JSON; reads back the leaves that are plain names."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        self._tree: Any = spec.options["tree"]
        self._encoding = context.encoding
        # What ASCII lacks is written as \uXXXX, which every line can carry.
        is_ascii = context.encoding != "utf-8"
        self._encode = json.JSONEncoder(
            ensure_ascii=is_ascii, allow_nan=False, separators=(",", ":")
        ).encode

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the JSON text; raise `NotWritable` or `ExpressionError`."""
        value = _filled(self._tree, namespace)
        try:
            return self._encode(value).encode(self._encoding)
        except TypeError as error:
            raise NotWritable(f"this cannot be written as JSON: {error}") from None
        except UnicodeEncodeError as error:
            wrong = error.object[error.start]
            raise NotWritable(f"{wrong!r} cannot be written in {self._encoding}") from None
        except ValueError:
            raise NotWritable("JSON has no infinite number and no not-a-number") from None

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values in the places of plain names, or None when the rest differs."""
        try:
            value = json.loads(frame.text)
        except (BadText, ValueError, RecursionError):
            return None
        found: dict[str, object] = {}
        return found if _matches(self._tree, value, found) else None


def _filled(tree: Any, namespace: Mapping[str, object]) -> Any:
    if isinstance(tree, Template):
        return tree.evaluate(namespace)
    if isinstance(tree, dict):
        return {name: _filled(inner, namespace) for name, inner in tree.items()}
    if isinstance(tree, list):
        return [_filled(inner, namespace) for inner in tree]
    return tree


def _matches(tree: Any, value: Any, found: dict[str, object]) -> bool:
    if isinstance(tree, Template):
        name = tree.source.strip().removeprefix("{{").removesuffix("}}").strip()
        if name.isidentifier() and name in tree.names:
            found[name] = value
        return True
    if isinstance(tree, dict):
        return (
            isinstance(value, dict)
            and tree.keys() == value.keys()
            and all(_matches(inner, value[name], found) for name, inner in tree.items())
        )
    if isinstance(tree, list):
        return (
            isinstance(value, list)
            and len(tree) == len(value)
            and all(_matches(*pair, found) for pair in zip(tree, value, strict=True))
        )
    return type(tree) is type(value) and tree == value
