"""How a frame is read and written, as declared: a form, and what the form's parser made of it.

A *form* is one way of saying what is in a frame (``regex``, ``struct``, ``json`` …). Each form has
a parser in `urc.config`, which fills `options`, and a factory in `urc.protocol`, which reads them;
the two agree on what is in there, and nobody else looks.

Reading a frame gives *fields*: name → raw value. A field that is named like a signal sets it; one
whose name starts with ``_`` stays inside the document (conditions, correlation, command replies).
"""

from collections.abc import Mapping
from typing import NamedTuple

from urc.expressions import Template
from urc.model.values import NOTHING, Conversion
from urc.patterns import Pattern

__all__ = ["Envelope", "Payload", "ReadSpec", "WriteSpec"]


class Envelope(NamedTuple):
    """What goes over a transport that carries messages instead of bytes."""

    verb: str
    """``publish``, ``call``, ``goal``, ``request`` …: what the transport is asked to do."""
    attributes: Mapping[str, object] = NOTHING
    """What addresses it: topic, type, method, path, headers, quality of service …"""
    body: object = None
    """JSON-like data, or bytes."""


Payload = bytes | Envelope
"""One frame without its framing."""


class ReadSpec(NamedTuple):
    """How a frame becomes fields."""

    form: str
    """Row of the readers' table: ``regex`` …"""
    options: Mapping[str, object] = NOTHING
    fields: tuple[str, ...] = ()
    """Every field that it can give, in the order of the frame; then the names of `sets`."""
    conversions: Mapping[str, Conversion] = NOTHING
    """Field → conversion of this frame alone; the signal's own comes after it."""
    sets: Mapping[str, Template] = NOTHING
    """Signal → expression over the converted fields."""
    when: Template | None = None
    """Expression over the converted fields; the frame is another one where it is not true."""
    lines: int | Pattern | None = None
    """The reply is that many frames, or all up to one that the pattern finds; joined by LF."""


class WriteSpec(NamedTuple):
    """How arguments become a frame."""

    form: str
    """Row of the writers' table: ``text`` …"""
    options: Mapping[str, object] = NOTHING
    names: frozenset[str] = frozenset()
    """Root names that its templates use."""
    settings: frozenset[str] = frozenset()
    """Names used as ``settings.NAME``."""
