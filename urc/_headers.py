"""HTTP headers reserved for URC, because they identify the sender or delimit the request.

Browsers forbid scripts these headers for the same reason. With these headers, a document could
pretend to be a page of the dashboard, a page of another program, or a proxy.
"""

from typing import Final

__all__ = ["is_reserved"]

_NAMES: Final = frozenset(
    (
        *("host", "origin", "referer", "cookie", "forwarded", "via", "x-real-ip"),
        *("connection", "content-length", "expect", "te", "trailer", "transfer-encoding"),
        *("keep-alive", "upgrade"),
    )
)
_PREFIXES: Final = ("sec-", "proxy-", "x-forwarded-")


def is_reserved(name: str) -> bool:
    """Return whether `name`, in any case, is a reserved header."""
    low = name.strip().lower()
    return low in _NAMES or low.startswith(_PREFIXES)
