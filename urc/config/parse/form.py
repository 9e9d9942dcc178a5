"""Finds the form of a frame and defines the interface of the form parsers.

Each form has a module in the package ``forms``. Modules for received forms implement `ReadForm`,
and modules for sent forms implement `WriteForm`.
"""

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, NamedTuple, Protocol, cast

from urc.config.form_table import READ_FORMS, WRITE_FORMS
from urc.config.node import Node, Problems
from urc.config.parse.form_options import beside_form
from urc.expressions import Template
from urc.model.binary import Item
from urc.model.driver import FramingSpec
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.values import NOTHING
from urc.registry import Registries

__all__ = [
    "FormContext",
    "ReadForm",
    "WriteForm",
    "body_form",
    "parse_read",
    "parse_write",
    "read_form",
    "write_form",
]

_BODIES = ("json", "text", "hex", "bytes", "struct")
"""Allowed forms of an envelope's body."""
_NO_READ = ReadSpec("regex")
_NO_WRITE = WriteSpec("text")


class FormContext(NamedTuple):
    """Properties of the driver and transport that a form parser needs."""

    encoding: str = "utf-8"
    """Text encoding of the transport."""
    signals: frozenset[str] = frozenset()
    """Names of all the driver's signals."""
    types: Mapping[str, tuple[Item, ...]] = NOTHING
    """Items of the reusable structs under ``types``, by name."""
    enums: Mapping[str, tuple[tuple[int, str], ...]] = NOTHING
    """Numbers and words of the driver's enums, by name."""
    catalog: Registries | None = None
    """Registered transports and framings, for a frame that declares its own framing."""
    framing: FramingSpec | None = None
    """Framing of the transport; None for a frame that declares its own framing."""


class ReadForm(Protocol):
    """A module that parses one form of received frames."""

    def parse_read(self, part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
        """Return the declaration at `part`; None if a problem was reported."""

    def place_of(self, part: Node, field: str) -> tuple[Node, dict[str, Any]]:
        """Return the node and the arguments of `Problems.error` that locate `field`."""


class WriteForm(Protocol):
    """A module that parses one form of sent frames."""

    def parse_write(self, part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
        """Return the declaration at `part`; None if a problem was reported."""

    def templates(self, part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
        """Return every template of the frame, with its position."""


def read_form(part: Node) -> tuple[Node, ReadForm] | None:
    """Return the value under a form's key in a reply or message, and the form's module."""
    for key in READ_FORMS:
        inner = part.get(key)
        if inner is not None:
            return inner, cast("ReadForm", import_module(READ_FORMS[key]))
    return None


def write_form(part: Node) -> tuple[Node, WriteForm]:
    """Return the value under ``send:``, or under the form's key there, and the form's module."""
    if isinstance(part.data, dict):
        for key in part.data:
            if key in WRITE_FORMS:
                return part.must(key), cast("WriteForm", import_module(WRITE_FORMS[key]))
    module = "urc.config.parse.forms.frames" if isinstance(part.data, list) else WRITE_FORMS["text"]
    return part, cast("WriteForm", import_module(module))


def body_form(part: Node) -> tuple[Node, WriteForm] | None:
    """Return the value under a form's key in an envelope, and the form's module."""
    for key in part.data:
        if key in _BODIES:
            return part.must(key), cast("WriteForm", import_module(WRITE_FORMS[key]))
    return None


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec:
    """Return the declaration of the received frame at `part`, in any form."""
    given = [key for key in READ_FORMS if key in part.data]
    if len(given) != 1:
        found = " and ".join(f"'{key}'" for key in given)
        problems.error(
            part,
            "two-forms" if given else "missing-form",
            f"{found} both define the form of this frame"
            if given
            else "the form of the frame is missing",
            at=given[1] if given else "",
            key=True,
            hint=f"write exactly one of: {', '.join(READ_FORMS)}",
        )
        return _NO_READ
    found_form = read_form(part)
    if found_form is None:
        return _NO_READ
    inner, form = found_form
    spec = form.parse_read(inner, problems, context) or _NO_READ
    return beside_form(part, spec, problems)


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec:
    """Return the declaration of the sent frame under ``send:``, in any form."""
    inner, form = write_form(part)
    return form.parse_write(inner, problems, context) or _NO_WRITE
