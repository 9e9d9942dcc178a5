"""The form ``struct``: binary frames, item by item."""

from collections.abc import Mapping
from typing import cast

from urc.expressions import COUNTERS, ExpressionError, quoted
from urc.model.binary import Item, joined_name, names_of
from urc.model.payload import Payload, ReadSpec, WriteSpec
from urc.protocol.struct.read_source import generate_read
from urc.protocol.struct.write import build_write_steps, write_frame
from urc.protocol.struct.write_source import generate_write
from urc.protocol.values.payload import BadText, CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import counter_in

__all__ = ["StructReader", "StructWriter"]


class StructReader:
    """A reader for the items in a frame; it also writes frames from fields."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._items = cast("tuple[Item, ...]", spec.options["items"])
        self._names = frozenset(names_of(self._items))
        self._encoding = context.encoding
        self.read = generate_read(self._items, context.encoding)
        """Generated function that returns the fields, or None if the frame does not match; it may
        raise `BadItem`."""
        self._steps = build_write_steps(self._items, context.encoding, is_lenient=True)
        # A reply contains the number of its request, which `match` supplies.
        self._outer = {"settings": context.settings, COUNTERS: lambda name, low, high: low}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a frame with `fields`; missing fields are zero."""
        known = {name: value for name, value in fields.items() if name in self._names}
        data = write_frame(self._steps, {**known, **self._outer})
        try:
            found = self.read(Frame(data, self._encoding))
        except BadText as error:
            raise NotWritable(str(error)) from None
        if found is None:
            raise NotWritable(f"no valid frame has the fields {quoted(known)}")
        return data


class StructWriter:
    """A writer for the items in a frame; it also reads the arguments back."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        items = cast("tuple[Item, ...]", spec.options["items"])
        self.write = generate_write(items, context.encoding)
        """Generated function that returns the frame, or raises `NotWritable`."""
        named, counters = _with_counters(items)
        self._names = {name: name for name in names_of(items, sent=True)} | counters
        self._read = generate_read(named, context.encoding)

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the arguments in a frame; None if the frame does not match.

        A counter's number has the key ``seq.NAME``.
        """
        try:
            found = self._read(frame)
        except (BadText, ExpressionError):
            return None
        if found is None:
            return None
        names = self._names
        return {names[name]: value for name, value in found.items() if name in names}


def _with_counters(items: tuple[Item, ...]) -> tuple[tuple[Item, ...], dict[str, str]]:
    """Give each counter an id; return the items, and the names ``seq.NAME`` keyed by these ids."""
    named, counters = list(items), dict[str, str]()
    for place, item in enumerate(items):
        counter = counter_in(item.value.source) if item.value is not None else ""
        if counter:
            named[place] = item._replace(id=item.id or f"_seq_{counter}")
            counters[named[place].id] = f"seq.{counter}"
        elif item.kind == "struct" and item.times is None:
            inner, found = _with_counters(item.items)
            named[place] = item._replace(items=inner)
            counters |= {joined_name(item.id, name): one for name, one in found.items()}
    return tuple(named), counters
