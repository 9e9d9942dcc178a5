"""A parser of ``multipart/x-mixed-replace`` bodies (MJPEG).

The parser does no I/O: the input is bytes, and the output is parts.

Many cameras violate the multipart format (RFC 2046, section 5.1). The parser accepts quoted and
unquoted boundaries in the header, and ignores leading dashes there and in the body. Parts without
Content-Length and lines that end in LF alone are also accepted. Every part and header has a maximum
size; larger parts or headers make the stream invalid.
"""

import re
from email.message import Message
from typing import Final, Literal

__all__ = ["MAX_BOUNDARY", "MAX_HEADER_BYTES", "MultipartParser", "MultipartFault", "boundary_of"]

MAX_BOUNDARY: Final = 200
"""Maximum length of a boundary, in characters; RFC 2046 permits 70, but some cameras use more."""
MAX_HEADER_BYTES: Final = 8192
"""Maximum number of bytes in the headers of one part, and between two parts."""

_LENGTH: Final = re.compile(rb"^content-length[ \t]*:[ \t]*(\d{1,15})[ \t]*$", re.I | re.M)


class MultipartFault(ValueError):
    """Raised for an invalid multipart stream, or for a stream that exceeds a limit."""


def boundary_of(content_type: str) -> bytes:
    """Return the boundary of a Content-Type header, without leading dashes.

    Raises:
        MultipartFault: the type is not multipart, or the boundary is missing or too long.
    """
    header = Message()
    header["content-type"] = content_type
    if header.get_content_maintype() != "multipart":
        found = content_type or "no Content-Type"
        raise MultipartFault(f"the response is {found}, not multipart/x-mixed-replace")
    named = header.get_param("boundary", "")
    core = (named if isinstance(named, str) else "").strip().lstrip("-")
    if not core:
        raise MultipartFault("the Content-Type has no boundary")
    if len(core) > MAX_BOUNDARY or not core.isascii():
        raise MultipartFault(
            f"the boundary has more than {MAX_BOUNDARY} characters, or contains invalid characters"
        )
    return core.encode()


class MultipartParser:
    """An incremental splitter of a multipart body into parts without their headers."""

    def __init__(self, boundary: bytes, max_part_bytes: int) -> None:
        """Create a splitter for `boundary` (see `boundary_of`) that limits the size of parts."""
        # Between parts, the preceding line break and the dashes may be missing. Inside a part, they
        # distinguish a delimiter from the image.
        self._loose = re.compile(rb"(?:\A|\r?\n)-*" + re.escape(boundary))
        self._strict = re.compile(rb"\r?\n-+" + re.escape(boundary))
        self._keep = len(boundary) + 80
        """Number of bytes at the end of the buffer to search again, because they may contain an
        incomplete delimiter."""
        self._most = max_part_bytes
        self._buffer = bytearray()
        self._state: Literal["seek", "rest", "head", "counted", "open", "ended"] = "seek"
        self._from = 0
        self._length = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Process the next piece of the body and return the completed parts.

        Raises:
            MultipartFault: a part or header has no end, or is too large.
        """
        self._buffer += data
        parts: list[bytes] = []
        steps = {
            "seek": self._seek, "rest": self._rest, "head": self._head,
            "counted": self._counted, "open": self._open, "ended": self._drop,
        }  # fmt: skip
        while steps[self._state](parts):
            pass
        return parts

    def _seek(self, parts: list[bytes]) -> bool:
        """Skip the bytes before the next delimiter."""
        found = self._loose.search(self._buffer, self._from)
        if found is None:
            self._from = max(0, len(self._buffer) - self._keep)
            if len(self._buffer) > MAX_HEADER_BYTES:
                raise MultipartFault(f"no boundary within {MAX_HEADER_BYTES} bytes")
            return False
        self._cut(found.end(), "rest")
        return True

    def _rest(self, parts: list[bytes]) -> bool:
        """Skip the rest of the delimiter line; two dashes in this line end the stream."""
        if len(self._buffer) < 2:
            return False
        if self._buffer.startswith(b"--"):
            self._state = "ended"
            return True
        end = self._buffer.find(b"\n")
        if end < 0:
            self._check_header()
            return False
        self._cut(end + 1, "head")
        return True

    def _head(self, parts: list[bytes]) -> bool:
        """Parse the headers of a part up to the empty line."""
        found = _EMPTY_LINE.search(self._buffer)
        if found is None:
            self._check_header()
            return False
        if found.end() > MAX_HEADER_BYTES:
            raise MultipartFault(f"the headers of a part exceed {MAX_HEADER_BYTES} bytes")
        head = bytes(self._buffer[: found.end()]).replace(b"\r", b"")
        length = _LENGTH.search(head)
        self._length = int(length[1]) if length else 0
        if self._length > self._most:
            raise MultipartFault(
                f"a part has {self._length} bytes; at most {self._most} are permitted"
            )
        self._cut(found.end(), "counted" if length else "open")
        return True

    def _counted(self, parts: list[bytes]) -> bool:
        """Extract a part whose headers state its length."""
        if len(self._buffer) < self._length:
            return False
        parts.append(bytes(self._buffer[: self._length]))
        self._cut(self._length, "seek")
        return True

    def _open(self, parts: list[bytes]) -> bool:
        """Extract a part without a stated length, up to the next delimiter."""
        found = self._strict.search(self._buffer, self._from)
        end = found.start() if found else len(self._buffer) - self._keep
        if end > self._most:
            raise MultipartFault(f"a part has no end within {self._most} bytes")
        if found is None:
            self._from = max(0, end)
            return False
        parts.append(bytes(self._buffer[:end]))
        self._cut(found.end(), "rest")
        return True

    def _drop(self, parts: list[bytes]) -> bool:
        self._buffer.clear()
        return False

    def _check_header(self) -> None:
        if len(self._buffer) > MAX_HEADER_BYTES:
            raise MultipartFault(f"the headers of a part exceed {MAX_HEADER_BYTES} bytes")

    def _cut(self, end: int, state: Literal["seek", "rest", "head", "counted", "open"]) -> None:
        del self._buffer[:end]
        self._from = 0
        self._state = state


_EMPTY_LINE: Final = re.compile(rb"\A\r?\n|\n\r?\n")
