"""Reserved HTTP headers, which identify the sender or delimit the request.

With a reserved header, a document could impersonate a dashboard page, another program's page, or a
proxy. Browsers also prevent scripts from setting reserved headers.
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
    """Return whether `name` is a reserved header, ignoring case."""
    low = name.strip().lower()
    return low in _NAMES or low.startswith(_PREFIXES)
