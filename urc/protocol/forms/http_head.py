"""Status and headers of an HTTP response as fields.

Pure. `HeadReader` adds the status and the headers to the body's reader, for both reading and
writing.
"""

from collections.abc import Mapping
from typing import Final

from urc.expressions import text_of
from urc.model.payload import Envelope, Payload, ReadSpec
from urc.protocol.values.payload import Frame, NotWritable, PayloadReader

__all__ = ["LOCATION", "STATUS", "HeadReader", "is_redirect"]

STATUS: Final = "status"
"""Name under which declarations read the status code, as if it were a header."""
_REDIRECTS: Final = 3
"""First digit of redirect status codes."""
LOCATION: Final = "location"
"""Header that contains the target URL of a redirect."""


def is_redirect(frame: Frame) -> bool:
    """Return whether a response is a redirect."""
    status = frame.attributes.get(STATUS)
    return isinstance(status, int) and status // 100 == _REDIRECTS


class HeadReader:
    """A reader for the status and headers, with another reader for the body.

    If a header is missing from the response, its field is omitted.
    """

    def __init__(self, reader: PayloadReader, spec: ReadSpec) -> None:
        self._reader = reader
        self._head = dict(spec.head)

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields; None if the frame does not match."""
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
        """Return the response with `fields`; raise `NotWritable` if impossible."""
        body = self._reader.write({k: v for k, v in fields.items() if k not in self._head})
        if not isinstance(body, bytes):
            raise NotWritable("only an HTTP response has a status and headers")
        named = {name: fields[field] for field, name in self._head.items() if field in fields}
        status = named.pop(STATUS, 200)
        if not isinstance(status, int):
            status = 200  # the default if the value is not a status
        headers = {name: text_of(value) for name, value in named.items()}
        attributes = {"ok": status < 400, "status": status, "headers": headers}
        return Envelope("response", attributes, body)
