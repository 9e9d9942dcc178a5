"""Expression filters that create bytes, hash bytes, or convert bytes to text.

Private to `urc.filters.table`. Text is encoded as UTF-8 before it is hashed. Each filter accepts
any value from a document. If a filter cannot handle a value, it raises TypeError or ValueError with
a message for users.
"""

import binascii
import struct
from collections.abc import Callable
from typing import Any, Final

from urc._number_codec import writer_of
from urc._number_types import NUMBER_NAMES, number_of

__all__ = ["BYTE_FILTERS", "TEXT_FILTERS", "together", "written_number"]

MAX_BYTES: Final = 65536
_YEAR_10000: Final = 253402300800


def written_number(name: str, value: object) -> bytes:
    """Return `value` encoded as the number type `name`; integer types round the value."""
    number = number_of(name)
    if number is None:
        raise ValueError(f"there is no type {_short(name)}")
    if not isinstance(value, (int, float)):
        raise TypeError(f"expected a number for {name!r}, found {_short(value)}")
    if number.kind == "float":
        try:
            return writer_of(number)(value)
        except (OverflowError, struct.error):
            raise ValueError(f"{_short(value)} is too large for {name!r}") from None
    if isinstance(value, float) and not abs(value) < 1e30:
        raise ValueError(f"expected a whole number for {name!r}, found {value!r}")
    whole, least, most = round(value), number.least, number.most
    if not least <= whole <= most:
        raise ValueError(f"{_short(whole)} does not fit into {name!r}: expected {least} to {most}")
    return writer_of(number)(whole)


def _number_filter(name: str) -> Callable[[object], bytes]:
    return lambda value: written_number(name, value)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _data(value: object) -> bytes:
    """Return bytes unchanged and text encoded as UTF-8."""
    data = value.encode("utf-8", "surrogatepass") if isinstance(value, str) else value
    if not isinstance(data, bytes):
        raise TypeError(f"expected text, found {_short(value)}")
    if len(data) > MAX_BYTES:
        raise ValueError(f"the text has more than {MAX_BYTES} bytes")
    return data


def together(left: object, right: object) -> bytes:
    """Return the concatenation of two values as bytes; text is encoded as UTF-8."""
    return _data(_data(left) + _data(right))


def _iso(value: object) -> str:
    """Return a time in seconds since 1970 in ISO format, such as ``2026-01-31T12:00:00.000Z``."""
    from datetime import UTC, datetime

    if not isinstance(value, (int, float)) or not 0 <= value < _YEAR_10000:
        raise ValueError(f"expected a time in seconds since 1970, found {_short(value)}")
    text = datetime.fromtimestamp(value, UTC).isoformat(timespec="milliseconds")
    return text.replace("+00:00", "Z")


def _hexbytes(value: object) -> bytes:
    if not isinstance(value, str):
        raise TypeError(f"expected hex digits, found {_short(value)}")
    try:
        return bytes.fromhex(value)
    except ValueError:
        raise ValueError(f"expected hex digits, found {_short(value)}") from None


def _b64decode(value: object) -> bytes:
    try:
        return binascii.a2b_base64(_data(value), strict_mode=True)
    except binascii.Error:
        raise ValueError(f"expected base64 text, found {_short(value)}") from None


def _hash(name: str) -> Callable[[object], str]:
    def digest(value: object) -> str:
        import hashlib  # takes 3 ms, and only documents with a hash need it

        return hashlib.new(name, _data(value), usedforsecurity=False).hexdigest()

    return digest


def _hmac_sha256(value: object, key: object) -> str:
    import hmac

    return hmac.new(_data(key), _data(value), "sha256").hexdigest()


def _b64encode(value: object) -> str:
    return binascii.b2a_base64(_data(value), newline=False).decode("ascii")


BYTE_FILTERS: Final[dict[str, Callable[..., Any]]] = {
    **{name: _number_filter(name) for name in NUMBER_NAMES},
    "b64decode": _b64decode,
    "hexbytes": _hexbytes,
    "utf8": _data,
}
"""Filters that return bytes and have no arguments, by name."""
TEXT_FILTERS: Final[dict[str, tuple[Callable[..., Any], int]]] = {
    "b64encode": (_b64encode, 0),
    "hmac_sha256": (_hmac_sha256, 1),
    "iso": (_iso, 0),
    "md5": (_hash("md5"), 0),
    "sha1": (_hash("sha1"), 0),
    "sha256": (_hash("sha256"), 0),
}
"""Filters that return text, by name: function and number of arguments."""
