"""Headers that no document may set: they say who asks, or how the request itself is read.

A browser keeps them from scripts for the same reason. A document that could set them would pass for
a page of the dashboard, of another program, or for a proxy that vouches for somebody.
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
    """Return whether `name`, in any case, is such a header."""
    low = name.strip().lower()
    return low in _NAMES or low.startswith(_PREFIXES)
