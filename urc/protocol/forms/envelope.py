"""The form for envelopes: publish, call, goal, request and get.

Pure. An envelope has an address (attributes) and a body. The body uses another form, such as JSON.
A JSON body stays plain data, because each message transport encodes it in its own way.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final, NamedTuple, cast
from urllib.parse import quote, unquote

from urc.expressions import Template, compile_template, quoted, split_template, text_of
from urc.model.payload import Envelope, Payload, WriteSpec
from urc.protocol.forms.json_text import JsonWriter, filled
from urc.protocol.forms.table import build_writer
from urc.protocol.values.payload import CodecContext, Frame, NotWritable, PayloadWriter
from urc.ros_names import relative_name, resolved_name

__all__ = ["EnvelopeWriter", "place_writer"]


_SETTINGS: Final = frozenset(("settings",))
_WILD: Final = ("+", "#", "\0")
_KEY_WILD: Final = ("*", "$", "?", "#", "\0")
_UP: Final = (".", "..")


class _AddressPiece(NamedTuple):
    template: Template
    is_value: bool
    """Whether the piece contains a command argument; other pieces contain only text or settings."""


class PathTemplate:
    """A writer for addresses: request paths, and the names of topics, services and actions.

    An argument value may fill only one segment of the address, so it cannot redirect the request.
    An argument value that provides the whole address may have several segments. Setting values are
    trusted, like the document's own text.
    """

    def __init__(
        self, pieces: tuple[_AddressPiece, ...], written: Callable[[str, bool], str]
    ) -> None:
        """Create a writer for `pieces`; `written(value, is_whole)` checks and converts a value."""
        self._pieces = pieces
        self._written = written

    def write(self, namespace: Mapping[str, object]) -> str:
        """Return the address; raise `NotWritable` or `ExpressionError`."""
        is_whole = len(self._pieces) == 1
        words = [
            self._written(text, is_whole) if is_value else text
            for text, is_value in (
                (text_of(one.template.evaluate(namespace)), one.is_value) for one in self._pieces
            )
        ]
        return "".join(words)


def place_writer(name: str, tree: object, *, has_keys: bool = False) -> PathTemplate | None:
    """Return the writer for the attribute `name`; None if the attribute has no restrictions.

    Args:
        name: name of the attribute, such as ``path`` or ``topic``.
        tree: compiled value of the attribute.
        has_keys: whether topics are Zenoh keys.
    """
    written = _key if has_keys and name == "topic" else _WRITTEN.get(name)
    if written is None or not isinstance(tree, Template) or tree.names <= _SETTINGS:
        return None
    pieces = []
    for _, literal, expression in split_template(tree.source):
        one = compile_template(literal if expression is None else f"{{{{{expression}}}}}")
        pieces.append(_AddressPiece(one, not one.names <= _SETTINGS))
    return PathTemplate(tuple(pieces), written)


def _path(text: str, is_whole: bool) -> str:
    """Return a value percent-encoded for a URL path; refuse values that change the path."""
    parts = text.split("/") if is_whole else [text]
    if any(part in _UP for part in parts):
        raise NotWritable(f"{quoted(text)} would change the path")
    return quote(text, safe="/" if is_whole else "")


def _name(text: str, is_whole: bool, *, what: str, wild: tuple[str, ...] = _WILD) -> str:
    """Check a value for use in the name of a topic, service or action, and return it."""
    for sign in (*wild, *(() if is_whole else ("/",))):
        if sign in text:
            raise NotWritable(f"{quoted(text)} would change the {what}: {sign!r} is not allowed")
    return text


_key: Final = partial(_name, what="topic", wild=_KEY_WILD)
_WRITTEN: Final[Mapping[str, Callable[[str, bool], str]]] = {
    "path": _path,
    **{what: partial(_name, what=what) for what in ("topic", "service", "action")},
}


_ADDRESS: Final = ("topic", "service", "action", "method", "path", "url", "query", "parameters")
"""Attributes that form an envelope's address; all other attributes are delivery options."""
_NAMES: Final = ("topic", "service", "action")
"""Attributes that a namespace of ROS applies to."""
_TEXTS: Final = ("query", "headers", "parameters")
"""Attributes whose values map names to text."""


class EnvelopeWriter:
    """A writer for envelopes; it also reads the values back from an envelope."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        self._verb = cast("str", spec.options["verb"])
        self._attributes = cast("Mapping[str, Any]", spec.options["attributes"])
        keys = context.has_keys
        places = {n: place_writer(n, tree, has_keys=keys) for n, tree in self._attributes.items()}
        self._places = {name: one for name, one in places.items() if one is not None}
        self._rest = {
            name: tree for name, tree in self._attributes.items() if name not in self._places
        }
        body = cast("WriteSpec | None", spec.options["body"])
        self._body: PayloadWriter | None = None if body is None else build_writer(body, context)
        self._context = context

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the envelope; raise `NotWritable` or `ExpressionError`."""
        attributes = filled(self._rest, namespace)
        for name, place in self._places.items():
            attributes[name] = place.write(namespace)
        for name in _NAMES:
            if isinstance(attributes.get(name), str):
                attributes[name] = resolved_name(attributes[name], self._context.namespace)
        for name in _TEXTS:
            if name in attributes:
                values = attributes[name].items()
                attributes[name] = {key: text_of(value) for key, value in values}
        if isinstance(self._body, JsonWriter):
            return Envelope(self._verb, attributes, self._body.value(namespace))
        return Envelope(self._verb, attributes, self._body and self._body.write(namespace))

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values, keyed by name; None if the envelope does not match."""
        envelope = frame.payload
        if not isinstance(envelope, Envelope) or envelope.verb != self._verb:
            return None
        found: dict[str, object] = {}
        for name in _ADDRESS:
            # The robot receives only the path of a URL.
            value = envelope.attributes.get("path" if name == "url" else name)
            if name == "path" and name in self._places and isinstance(value, str):
                value = unquote(value)
            if name not in self._attributes:
                continue
            tree = self._attributes[name]
            if name in _NAMES and isinstance(value, str):
                short = relative_name(value, self._context.namespace)
                if short != value and self._is_here(tree, short, found):
                    continue
            if not self._is_here(tree, value, found):
                return None
        if self._body is None:
            return found
        body = envelope.body
        if "type" in self._attributes and isinstance(self._body, JsonWriter):
            body = self._body.completed(body)
            envelope = envelope._replace(body=body)
        said = self._body.read(
            Frame(body if isinstance(body, bytes) else envelope, self._context.encoding)
        )
        return None if said is None else {**found, **said}

    def _is_here(self, tree: Any, value: Any, found: dict[str, object]) -> bool:
        """Return whether `value` matches `tree`; add the values to `found`, keyed by name."""
        if isinstance(tree, Mapping):
            if not isinstance(value, Mapping) or tree.keys() != value.keys():
                return False
            return all(self._is_here(inner, value[name], found) for name, inner in tree.items())
        if not isinstance(tree, Template):
            return text_of(tree) == text_of(value)
        if tree.names <= {"settings"}:
            return text_of(tree.evaluate({"settings": self._context.settings})) == text_of(value)
        written = WriteSpec("text", {"template": tree}, tree.names, tree.settings)
        text = Frame(text_of(value).encode(), "utf-8")
        said = build_writer(written, self._context._replace(encoding="utf-8")).read(text)
        found.update(said or {})
        return said is not None
