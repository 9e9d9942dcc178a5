"""What stands in the head of an http answer: its status and its headers, as fields.

Floor 3, pure. Wraps the reader of the body, in both directions.
"""

from collections.abc import Mapping
from typing import Final

from urc.expressions import text_of
from urc.model.codec import Envelope, Payload, ReadSpec
from urc.protocol.codec import Frame, NotWritable, Reader

__all__ = ["LOCATION", "STATUS", "HeadReader", "is_redirect"]

STATUS: Final = "status"
"""The name of the status among those of headers."""
_REDIRECTS: Final = 3
"""First digit of their status."""
LOCATION: Final = "location"
"""The header by which a robot says where to ask next."""


def is_redirect(frame: Frame) -> bool:
    """Return whether an answer sends whoever asked elsewhere."""
    status = frame.attributes.get(STATUS)
    return isinstance(status, int) and status // 100 == _REDIRECTS


class HeadReader:
    """Reads the body by another form, and the head beside it; a missing header is no field."""

    def __init__(self, reader: Reader, spec: ReadSpec) -> None:
        self._reader = reader
        self._head = dict(spec.head)

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields, or None when the frame is another one."""
        found = self._reader.read(frame)
        if found is None:
            return None
        headers = frame.attributes.get("headers")
        known: dict[str, object] = {}
        if isinstance(headers, Mapping):
            known = {str(name).lower(): value for name, value in headers.items()}
        known[STATUS] = frame.attributes.get(STATUS)
        head = {field: known.get(name) for field, name in self._head.items()}
        return {**found, **{field: value for field, value in head.items() if value is not None}}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the answer that would be read as `fields`; raise `NotWritable`."""
        body = self._reader.write({k: v for k, v in fields.items() if k not in self._head})
        if not isinstance(body, bytes):
            raise NotWritable("only an answer of http has a head")
        named = {name: fields[field] for field, name in self._head.items() if field in fields}
        status = named.pop(STATUS, 200)
        if not isinstance(status, int):
            status = 200  # something plausible that is no status
        headers = {name: text_of(value) for name, value in named.items()}
        attributes = {"ok": status < 400, "status": status, "headers": headers}
        return Envelope("response", attributes, body)
