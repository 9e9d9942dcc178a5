"""Field conversions, ``set`` and ``when`` for one frame.

Pure. `ShapedReader` adds conversions, ``set`` and ``when`` to a form's reader, for both reading and
writing.
"""

from collections.abc import Mapping

from urc.expressions import ExpressionError
from urc.model.payload import Payload, ReadSpec
from urc.protocol.forms.topics import frame_of
from urc.protocol.values.convert import BadValue, Unusable, build_conversion, build_inverse
from urc.protocol.values.payload import CodecContext, Frame, NotWritable, PayloadReader
from urc.protocol.values.wire_text import WireText

__all__ = ["ShapedReader"]


class ShapedReader:
    """A reader that converts a form's fields, checks ``when``, and adds the values from ``set``."""

    def __init__(self, inner: PayloadReader, spec: ReadSpec, context: CodecContext) -> None:
        self._inner = inner
        self._conversions = {
            name: convert
            for name, one in spec.conversions.items()
            if (convert := build_conversion(one)) is not None
        }
        self._inverses = {
            name: back
            for name, one in spec.conversions.items()
            if (back := build_inverse(one)) is not None
        }
        self._sets = dict(spec.sets)
        self._when = spec.when
        self._settings = context.settings
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields; None if the frame does not match."""
        raw = self._inner.read(frame)
        if raw is None:
            return None
        found = dict(raw)
        for name, convert in self._conversions.items():
            if name in found:
                try:
                    found[name] = convert(found[name])
                except BadValue as error:
                    found[name] = Unusable(str(error))
        if self._when is None and not self._sets:
            return found
        namespace = {"settings": self._settings, **found}
        if self._when is not None and not self._is_meant(namespace):
            return None
        for name, template in self._sets.items():
            try:
                found[name] = template.evaluate(namespace)
            except ExpressionError as error:
                if all(one in namespace for one in template.names):
                    found[name] = _without_value(error, [found.get(one) for one in template.names])
        return found

    def _is_meant(self, namespace: Mapping[str, object]) -> bool:
        # As in 'match', text equals the number that it spells.
        names = {
            name: WireText(value) if isinstance(value, str) else value
            for name, value in namespace.items()
        }
        try:
            return self._when is not None and bool(self._when.evaluate(names))
        except ExpressionError:
            return False  # the condition reads a field of another frame

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a frame with `fields`, excluding the fields from ``set``."""
        raw: dict[str, object] = {}
        for name, value in fields.items():
            if name in self._sets:
                continue
            back = self._inverses.get(name)
            try:
                raw[name] = value if back is None else back(value)
            except BadValue as error:
                raise NotWritable(f"{name}: {error}") from None
        payload = self._inner.write(raw)
        if self._when is not None and self.read(frame_of(payload, self._encoding)) is None:
            raise NotWritable(f"{self._when.source!r} is not true for these values")
        return payload


def _without_value(error: ExpressionError, operands: list[object]) -> Unusable | None:
    """Return the first unusable operand; else None if an operand is missing, or the error."""
    for operand in operands:
        if isinstance(operand, Unusable):
            return operand
    return None if None in operands else Unusable(str(error))
