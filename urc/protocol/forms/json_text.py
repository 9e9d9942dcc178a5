"""The form ``json`` for sending: JSON text with typed values in place of templates."""

import json
from collections.abc import Mapping
from typing import Any, Final

from urc.expressions import ExpressionError, Template, quoted
from urc.model.payload import Envelope, Payload, WriteSpec
from urc.protocol.values.payload import BadText, CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import counter_in

__all__ = ["JsonWriter", "filled", "matches"]

_EXACT: Final = float(2**53)
"""All whole numbers up to this one are exact as floats."""


class JsonWriter:
    """A writer for compact JSON; it reads back values whose template is a name or a counter."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        self._tree: Any = spec.options["tree"]
        is_stamped = spec.options.get("is_stamped")
        if isinstance(is_stamped, Template) and _holds(is_stamped, context.settings):
            self._tree = spec.options["stamped"]
        self._encoding = context.encoding
        # Other characters become \uXXXX in ASCII, which every connection can carry.
        is_ascii = context.encoding != "utf-8"
        self._encode = json.JSONEncoder(
            ensure_ascii=is_ascii, allow_nan=False, separators=(",", ":")
        ).encode

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the JSON text; raise `NotWritable` or `ExpressionError`."""
        try:
            return self._text(_plain(filled(self._tree, namespace))).encode(self._encoding)
        except UnicodeEncodeError as error:
            wrong = error.object[error.start]
            raise NotWritable(f"{quoted(wrong)} cannot be encoded in {self._encoding}") from None

    def _text(self, value: object) -> str:
        try:
            return self._encode(value)
        except TypeError as error:
            raise NotWritable(f"the value cannot be written as JSON: {error}") from None
        except ValueError:
            raise NotWritable("JSON cannot represent infinity or NaN") from None

    def value(self, namespace: Mapping[str, object]) -> object:
        """Return the JSON data before encoding; raise `NotWritable` or `ExpressionError`."""
        value = _plain(filled(self._tree, namespace))
        self._text(value)
        return value

    def completed(self, value: object) -> object:
        """Return a ROS message with its missing members set to zero, as a ROS bridge does."""
        return _completed(self._tree, value)

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values of templates that are only a name; None if the rest differs."""
        payload = frame.payload
        try:
            value = payload.body if isinstance(payload, Envelope) else json.loads(frame.text)
        except (BadText, ValueError, RecursionError):
            return None
        found: dict[str, object] = {}
        return found if matches(self._tree, value, found) else None


def _holds(chosen: Template, settings: Mapping[str, object]) -> bool:
    """Return whether an expression over settings is true; false in manuals, without settings."""
    try:
        return bool(chosen.evaluate({"settings": settings}))
    except ExpressionError:
        return False


def filled(tree: Any, namespace: Mapping[str, object]) -> Any:
    """Return a copy of `tree` with all templates evaluated."""
    if isinstance(tree, Template):
        return tree.evaluate(namespace)
    if isinstance(tree, dict):
        return {name: filled(inner, namespace) for name, inner in tree.items()}
    if isinstance(tree, list):
        return [filled(inner, namespace) for inner in tree]
    return tree


def _plain(value: Any) -> Any:
    """Return JSON data with whole floats as integers, so equal numbers have the same text.

    Some programs on robots refuse ``61.0`` as an integer, and none refuses ``61`` as a float.
    """
    if isinstance(value, float):
        is_whole = value.is_integer() and abs(value) <= _EXACT
        return int(value) if is_whole else value
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list) else value


def _completed(tree: Any, value: Any) -> Any:
    if not isinstance(tree, dict) or not isinstance(value, dict):
        return value
    lacks = tree.keys() - value.keys()
    missing: dict[str, Any] = {name: {} if isinstance(tree[name], dict) else 0 for name in lacks}
    return {name: _completed(tree.get(name), inner) for name, inner in {**value, **missing}.items()}


def matches(tree: Any, value: Any, found: dict[str, object]) -> bool:
    """Return whether `value` matches `tree`; add the values of plain names to `found`."""
    if isinstance(tree, Template):
        name = tree.source.strip().removeprefix("{{").removesuffix("}}").strip()
        if name.isidentifier() and name in tree.names:
            found[name] = value
        elif counter := counter_in(name):
            found[f"seq.{counter}"] = value
        return True
    if isinstance(tree, dict):
        return (
            isinstance(value, dict)
            and tree.keys() == value.keys()
            and all(matches(inner, value[name], found) for name, inner in tree.items())
        )
    if isinstance(tree, list):
        return (
            isinstance(value, list)
            and len(tree) == len(value)
            and all(matches(*pair, found) for pair in zip(tree, value, strict=True))
        )
    # JSON writers treat 0 and 0.0 as the same number, but true is different
    return isinstance(tree, bool) is isinstance(value, bool) and bool(tree == value)
